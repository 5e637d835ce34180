"""A damaged status.json or sweep.json is named and passed over; it stops no command and no run."""

import json
import logging
from pathlib import Path

import pytest
from damaged_documents import Plant
from damaged_states import PLANS, STATUS
from study_rows import answer_of, make_row, place_of, read_tex, write_finished

from jointsdf.runs import status
from jointsdf.runs.plan import plan, planned_runs
from jointsdf.runs.row import write_row
from jointsdf.study.__main__ import main as study

CONTENT = {"state": "running", "step": 5, "steps": 20, "seconds": 1.0, "died_at": 3, "host": "a", "process": 1}


def assert_line(line: str, path: Path) -> None:
    assert str(path) in line
    assert line.isprintable(), line
    assert len(line) < 700


@pytest.mark.parametrize("plant", STATUS.values(), ids=STATUS)
def test_a_damaged_status_is_named_and_blocks_nothing(
    tmp_path: Path, plant: Plant, caplog: pytest.LogCaptureFixture
) -> None:
    folder = place_of(tmp_path, "siren", "abc_0001")
    folder.mkdir(parents=True)
    plant(folder / "status.json", CONTENT)
    found = status.read_state(folder)
    assert (found.kind, found.step, found.killed_twice) == ("missing", 0, False)
    assert found.problem.startswith(f"{folder / 'status.json'}: ")
    write_finished(tmp_path, "siren", "abc_0002")
    lines = answer_of(caplog, "status", "main", str(tmp_path))
    assert lines[0].endswith("2 runs: 1 done, 1 missing; about 2 min left, one after the other")
    (line,) = (line for line in lines if "status.json" in line)
    assert_line(line, folder / "status.json")
    if (folder / "status.json").is_dir():
        return  # a folder is not removed for a file
    status.begin(folder)
    status.note_progress(folder, 6, 20, 1.5)
    assert status.read_state(folder) == status.RunState("stopped", 6, 20, 1.5)


def test_a_failure_that_cannot_be_recorded_stops_no_sweep(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "status.json").mkdir()
    status.fail(tmp_path, "loss is nan", ValueError("loss is nan"))
    (line,) = caplog.messages
    assert_line(line, tmp_path)
    (tmp_path / "file").write_text("")
    status.fail(tmp_path / "file", "loss is nan", ValueError("loss is nan"))


def test_a_reason_of_many_lines_is_shown_as_one(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    folder = place_of(tmp_path, "siren", "abc_0001")
    folder.mkdir(parents=True)
    (folder / "status.json").write_text(json.dumps({"state": "failed", "error": "a\n\x1b[2Jb" + "x" * 5000}))
    lines = answer_of(caplog, "status", "main", str(tmp_path))
    (line,) = (line for line in lines if line.startswith("failed: "))
    assert line.isprintable()
    assert len(line) < 2500


@pytest.mark.parametrize("plant", PLANS.values(), ids=[name.replace("/", "|") for name in PLANS])
def test_a_damaged_plan_is_named_and_passed_over(
    tmp_path: Path, plant: Plant, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "main/sweep.json"
    path.parent.mkdir()
    plant(path, {"runs": ["base/siren/abc_0001/seed0"]})
    write_row(place_of(tmp_path, "siren", "abc_0002"), make_row("siren", "abc_0002", study="main", cd_l1=0.5))
    assert planned_runs(path.parent) == []
    lines = answer_of(caplog, "status", "main", str(tmp_path))
    assert lines[0].endswith("1 runs: 1 done")
    (line,) = (line for line in lines if str(path) in line)
    assert_line(line, path)
    caplog.clear()
    assert study(["tables", str(tmp_path), "--results", str(tmp_path / "none")]) == 0
    (line,) = (line for line in caplog.messages if str(path) in line)
    assert_line(line, path)
    assert "Files that cannot be read or repeat a run, and are left out: 1." in " ".join(
        read_tex(tmp_path, "main_reconstruction").split()
    )
    if path.is_dir():
        return
    wanted = place_of(tmp_path, "siren", "abc_0003")
    plan(path.parent, [wanted])
    assert planned_runs(path.parent) == [wanted]
    assert any(str(path) in line for line in caplog.messages)


def test_a_plan_of_a_large_study_is_read(tmp_path: Path) -> None:
    folders = [place_of(tmp_path, "siren", f"{'x' * 90}{k:05}-0a1b2c") for k in range(20_000)]
    plan(tmp_path / "main", folders)
    assert planned_runs(tmp_path / "main") == folders


def test_names_of_any_script_are_planned(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    folders = [place_of(tmp_path, "siren", name) for name in ("零件-0a1b2c", "Gehäuse-0a1b2c", "...-0a1b2c")]
    plan(tmp_path / "main", folders)
    with caplog.at_level(logging.INFO):
        assert planned_runs(tmp_path / "main") == folders
        assert study(["status", "main", str(tmp_path)]) == 0
