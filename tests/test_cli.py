"""The console command, and the help of every command in one screen."""

import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner
from command_line import PLACE, QUICK, call
from run_folders import own_copy

import jointsdf
from jointsdf.cli import main

pytestmark = pytest.mark.filterwarnings("default")
LINES, WIDTH = 50, 120  # of a screen


def answer(*words: str):
    return CliRunner().invoke(main, words)


def test_the_version_is_the_packages() -> None:
    assert answer("--version").output == f"jointsdf, version {jointsdf.__version__}\n"


@pytest.mark.parametrize("words", [["--help"], *([name, "--help"] for name in main.commands)], ids=" ".join)
def test_every_help_fits_a_screen_and_names_its_command(words: list[str]) -> None:
    found = answer(*words)
    assert found.exit_code == 0, found.output
    lines = found.output.splitlines()
    assert len(lines) <= LINES
    assert max(map(len, lines)) <= WIDTH
    assert "Traceback" not in found.output
    assert lines[0].lower().startswith("usage: " if words == ["--help"] else f"usage: jointsdf {words[0]} ")


def test_the_help_of_a_run_has_the_yamls_comments_and_choices() -> None:
    text = call("train.py", "--help").text
    assert "(near" not in text
    for said in (
        "a catalogue name (abc_0001..abc_0050, part_01..part_50) or a path",
        "true: throw away what the run's folder holds",
        "deep_skip | hybrid | none | relu | siren*",
        "fast* | network | paper | points | raw_points | scan | smoke",
        "paths.outputs=outputs",
    ):
        assert said in text
    assert "hydra/" not in text
    assert "_target_" not in text


def test_the_help_of_evaluate_lists_its_own_keys_alone() -> None:
    lines = call("evaluate.py", "--help").lines
    assert [line.split("=")[0].strip() for line in lines if "=" in line and line.startswith("  ")] == ["run", "trust"]


def test_fit_is_train_py_and_evaluate_measures_it_again(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    command = [sys.executable, "-m", "jointsdf.cli"]
    done = subprocess.run([*command, "fit", *QUICK], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "outputs" / PLACE / "result.json").is_file()
    again = subprocess.run([*command, "evaluate", f"run=outputs/{PLACE}"], capture_output=True, text=True, check=False)
    assert again.returncode == 0, again.stderr
    assert "every score as stored" in again.stderr


@pytest.mark.parametrize("words", [["fit", "head=relux"], ["fit", "trainer.max_steps=0"], ["evaluate"], ["nothing"]])
def test_a_mistake_is_no_traceback(words: list[str], tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    done = subprocess.run([sys.executable, "-m", "jointsdf.cli", *words], capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "Traceback" not in done.stderr + done.stdout
    assert list(tmp_path.iterdir()) == []


def test_evaluate_names_files_that_are_not_those_of_the_run(tmp_path: Path) -> None:
    folder = own_copy(tmp_path)
    with (folder / "mesh.ply").open("ab") as file:
        file.write(b"\n")
    again = call("evaluate.py", f"run={folder}")
    assert again.code == 0, again.text
    warned = [line for line in again.lines if "changed since the run ended" in line]
    assert warned == [f"{folder / 'mesh.ply'}: changed since the run ended: its checksum is that of another file"]
    assert "every score as stored" in again.lines[-1]
