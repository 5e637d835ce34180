"""The built wheel, installed apart from the checkout, in an empty folder."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import PLACE, QUICK, ROOT

import jointsdf


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the package and its command; what it depends on comes from the environment of the tests."""
    folder = tmp_path_factory.mktemp("wheel")
    source, wheels, site = folder / "source", folder / "wheels", folder / "site"
    source.mkdir()
    for name in ("jointsdf", "conf", "sweeps"):
        shutil.copytree(ROOT / name, source / name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    alone = ["--no-deps", "--no-index"]
    subprocess.run([*pip, "wheel", *alone, "--no-build-isolation", "-w", str(wheels), str(source)], check=True)
    (wheel,) = wheels.glob("jointsdf-*.whl")
    subprocess.run([*pip, "install", *alone, "--target", str(site), str(wheel)], check=True)
    return site


def run(site: Path, folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(site), "OMP_NUM_THREADS": "1"}
    return subprocess.run(
        [sys.executable, *words], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


def test_the_wheel_holds_configs_catalogues_and_types(installed: Path) -> None:
    package = installed / "jointsdf"
    assert (package / "py.typed").is_file()
    for name in ("conf", "sweeps"):
        here = {path.relative_to(ROOT / name) for path in (ROOT / name).rglob("*.yaml")}
        there = package / "conf" if name == "conf" else package / "conf" / "sweeps"
        assert here == {path.relative_to(there) for path in there.rglob("*.yaml")} - (
            {path.relative_to(there) for path in (there / "sweeps").rglob("*.yaml")} if name == "conf" else set()
        )
    assert not list(installed.rglob("tests"))
    assert {path.name for path in (package / "shapes").glob("*.csv")} == {
        path.name for path in (ROOT / "jointsdf" / "shapes").glob("*.csv")
    }


def test_the_installed_command_fits_in_an_empty_folder(installed: Path, tmp_path: Path) -> None:
    command = str(installed / "bin" / "jointsdf")
    version = run(installed, tmp_path, command, "--version")
    assert version.stdout == f"jointsdf, version {jointsdf.__version__}\n", version.stderr
    done = run(installed, tmp_path, command, "fit", *QUICK)
    assert done.returncode == 0, done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["outputs"]
    assert (tmp_path / "outputs" / PLACE / "mesh.ply").is_file()
    again = run(installed, tmp_path, command, "evaluate", f"run=outputs/{PLACE}")
    assert "every score as stored" in again.stderr


def test_the_installed_library_is_the_one_that_answers(installed: Path, tmp_path: Path) -> None:
    code = (
        "import jointsdf; assert jointsdf.__file__.startswith(r'%s'), jointsdf.__file__; "
        "run = jointsdf.fit('part_01', recipe='smoke', overrides=%r, quiet=True); "
        "print(run.field.query([[0.0, 0.0, 0.0]]).part)"
    )
    done = run(installed, tmp_path, "-c", code % (installed, list(QUICK[1:])))
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("[")
    assert list(tmp_path.iterdir()) == []
