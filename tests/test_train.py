"""Output of `train.py`: lines off a terminal, a bar on one, folders of several runs."""

import json
import os
import pty
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from command_line import PLACE, QUICK, ROOT, assert_one_line_error, train

from jointsdf.shapes.builtin import BUILTINS

pytestmark = pytest.mark.filterwarnings("default")
PHASES = ("start", "load", "prepare", "fit", "extract", "measure", "draw")

SIDE = np.ptp(BUILTINS["part_01"]().vertices, axis=0).max()


def files_below(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())


def test_four_heads_are_four_rows_in_four_folders(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    answer = train("outputs", "-m", "head=relu,siren,hybrid,deep_skip")
    assert answer.code == 0, answer.text
    rows = [json.loads(path.read_text()) for path in tmp_path.rglob("result.json")]
    assert sorted(row["head"] for row in rows) == ["deep_skip", "hybrid", "relu", "siren"]
    assert [path.name for path in tmp_path.iterdir()] == ["outputs"]
    assert {path.name for path in (tmp_path / "outputs").iterdir()} <= {"smoke", ".hydra", ".companions"}
    assert not [path for path in tmp_path.rglob("*") if re.search(r"\d{4}-\d\d-\d\d|\d\d-\d\d-\d\d", path.name)]


def test_a_job_that_fails_does_not_stop_the_others(tmp_path):
    answer = train(tmp_path, "-m", "trunk.tap=9,3", "shape=part_01,part_99")
    assert answer.code == 1
    assert "Traceback" not in answer.text
    assert len([line for line in answer.lines if line.startswith("error: ")]) == 3
    assert [path.parent for path in tmp_path.rglob("result.json")] == [tmp_path / PLACE]


def test_a_missing_abc_shape_runs_under_the_name_of_what_it_is(tmp_path):
    absent = f"paths.abc_root={tmp_path / 'absent'}"
    answer = train(tmp_path / "out", "shape=abc_0001", absent)
    assert answer.code == 0
    assert "abc_0001 is not on this machine" in answer.lines[0]
    assert json.loads((tmp_path / "out" / PLACE / "result.json").read_text())["shape"] == "part_01"
    assert "abc_0001" not in " ".join(map(str, files_below(tmp_path / "out")))
    assert yaml.safe_load((tmp_path / "out" / PLACE / "config.yaml").read_text())["shape"] == "part_01"
    forbidden = train(tmp_path / "other", "shape=abc_0001", absent, "paths.abc_missing=error")
    assert_one_line_error(forbidden, "abc_0001", "paths.abc_root")


def process(tmp_path: Path, *overrides: str, **streams) -> subprocess.Popen:
    command = [sys.executable, ROOT / "train.py", *QUICK, f"paths.outputs={tmp_path / 'out'}", *overrides]
    return subprocess.Popen(command, cwd=tmp_path, **streams)


def test_off_a_terminal_it_is_quiet(tmp_path):
    """The whole output of a process: phases, mesh, folder, result; nothing of the libraries, nothing twice."""
    with process(tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as run:
        lines = run.communicate()[0].splitlines()
    assert run.returncode == 0
    begun = [line for line in lines if line.partition(":")[0] in PHASES]
    assert [line.partition(":")[0] for line in begun] == list(PHASES), lines
    assert lines[:2] == begun[:2] == ["start: torch and lightning", "load: part_01"]
    said = [line for line in lines if line not in begun]
    assert len(said) == 11, lines
    assert said[0] == "part_01: 2940 faces, 1 component, watertight, unit mm (assumed; unit=in says otherwise)"
    assert said[5].startswith("warning: part_01: its thinnest wall (6.72 mm) is under 2 cells of the grid")
    assert said[6] == str(tmp_path / "out" / PLACE)
    assert said[7].startswith("machine: ")
    assert said[8].startswith("part_01 siren: cd_l1 ")
    row = json.loads((tmp_path / "out" / PLACE / "result.json").read_text())["scores"]["unit"]
    within = re.match(r"99% of the surface is within (\S+) mm of the part \((\S+)% of its longest side\), ", said[9])
    assert within is not None, said[9]
    assert float(within[2]) == pytest.approx(100 * row["surface_p99"], abs=0.01)
    assert float(within[1]) == pytest.approx(row["surface_p99"] * SIDE, rel=0.05)
    assert f"{row['parts_pred']:.0f} of 6 parts" in said[9]
    assert str(tmp_path / "out" / PLACE / "preview.png") in said[10]
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_the_first_line_is_there_before_torch(tmp_path):
    """Importing torch and Lightning takes seconds; what a user typed is answered before."""
    unbuffered = {**os.environ, "PYTHONUNBUFFERED": "1", "PYTHONPROFILEIMPORTTIME": "1"}
    with process(tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=unbuffered) as run:
        lines = run.communicate()[0].splitlines()
    first = next(k for k, line in enumerate(lines) if line == "start: torch and lightning")
    imported = [k for k, line in enumerate(lines) if re.search(r"\| +(torch|lightning|scipy|trimesh)$", line)]
    assert len(imported) >= 4
    assert min(imported) > first, [lines[k] for k in imported if k < first]


def read_all(descriptor: int) -> str:
    chunks = []
    try:
        while chunk := os.read(descriptor, 65536):
            chunks.append(chunk)
    except OSError:  # how Linux says that the other end is closed
        pass
    return b"".join(chunks).decode(errors="replace")


@pytest.mark.slow
def test_on_a_terminal_a_bar_shows_steps_loss_and_speed(tmp_path):
    ours, theirs = pty.openpty()
    terminal = {**os.environ, "TERM": "xterm", "COLUMNS": "120"}
    steps = ["trainer.max_steps=150", "trainer.log_every=50"]
    with process(tmp_path, *steps, stdout=theirs, stderr=theirs, stdin=theirs, env=terminal) as run:
        os.close(theirs)
        text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", read_all(ours))
    os.close(ours)
    assert run.returncode == 0, text
    for name in PHASES:
        assert re.search(rf"(?:^|[\r\n]){name}(?::[^\r\n]*)?[\r\n]", text), name
    found = re.findall(r"(\d+)/150\s+loss (\d+\.\d+)\s+(\d+\.\d) it/s\s+(\d+:\d\d:\d\d|-:--:--)", text)
    assert found, text
    assert any(left != "-:--:--" for *_, left in found), "time left"
    assert "Traceback" not in text
