"""The documentation names what exists: files of the package, link targets, commands."""

import importlib.util
import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "jointsdf"
DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
LINK = re.compile(r"\]\(([^)\s]+)\)")


def package_files() -> set[str]:
    """Every module and table of the package, a folder for its `__init__.py`."""
    found = [path for path in PACKAGE.rglob("*") if path.suffix in (".py", ".csv")]
    names = {path.relative_to(PACKAGE).as_posix().replace("__init__.py", "") for path in found}
    return names - {""}


def test_architecture_names_every_file_of_the_package_and_no_other() -> None:
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    named = set(re.findall(r"^\| `([^`]+)` \|", text, re.MULTILINE))
    assert package_files() - named == set()
    assert {name for name in named - package_files() if not (ROOT / name).exists()} == set()


def test_readme_is_short() -> None:
    assert (ROOT / "README.md").stat().st_size <= 8192


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_relative_links_lead_to_files(document: Path) -> None:
    text = re.sub(r"^```.*?^```", "", document.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    targets = [link.partition("#")[0] for link in LINK.findall(text) if "://" not in link]
    missing = [target for target in targets if target and not (document.parent / target).exists()]
    assert not missing


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_modules_in_commands_can_be_imported(document: Path) -> None:
    names = re.findall(r"python -m (jointsdf[\w.]*|benchmarks[\w.]*)", document.read_text(encoding="utf-8"))
    missing = [name for name in names if importlib.util.find_spec(name.rstrip(".")) is None]
    assert not missing


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_files_of_the_project_are_named_as_they_are(document: Path) -> None:
    text = document.read_text(encoding="utf-8")
    names = re.findall(r"`((?:jointsdf|tests|conf|sweeps|benchmarks|docs|results)/[\w./-]*)`", text)
    missing = [name for name in names if not (ROOT / name).exists() and not re.search("mine|_build", name)]
    assert not missing


def test_the_licences_are_of_the_locked_packages() -> None:
    """`make lock` writes both."""
    script = runpy.run_path(str(ROOT / "docs" / "licences.py"))
    text = (ROOT / "docs" / "licences.md").read_text(encoding="utf-8")
    named = dict(re.findall(r"^\| ([a-z\d-]+) \| (\S+) \|", text, re.MULTILINE))
    assert named.pop("torch")
    assert named.pop("package") == "version"
    assert named == script["locked"]()
    for name in ("requirements.lock", "requirements-peers.lock"):
        lock = (ROOT / name).read_text(encoding="utf-8")
        assert all("--hash=sha256:" in entry for entry in re.split(r"\n(?=\w)", lock))


def test_the_lock_of_the_peers_adds_to_the_other_and_changes_nothing() -> None:
    script = runpy.run_path(str(ROOT / "docs" / "licences.py"))
    base, more = (script["locked"](ROOT / name) for name in ("requirements.lock", "requirements-peers.lock"))
    assert {"open3d", "pymeshlab", "pymaxflow", "libusb-package"} <= more.keys()
    assert not base.keys() & more.keys()
    assert "torch" not in more


def test_the_package_graph_is_that_of_the_imports() -> None:
    """`make docs` draws it anew."""
    script = runpy.run_path(str(ROOT / "docs" / "package_graph.py"))
    drawn = script["drawing"](script["import_graph"]())
    assert drawn == (ROOT / "docs" / "package_graph.svg").read_text(encoding="utf-8"), "python docs/package_graph.py"
