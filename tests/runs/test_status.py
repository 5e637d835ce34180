"""Run status on disk: progress and failures."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from jointsdf.runs import status as run_state
from jointsdf.runs.status import RunState, duration


def test_two_deaths_at_one_step_are_told_from_two_at_different_steps(tmp_path: Path) -> None:
    run_state.begin(tmp_path)
    run_state.note_progress(tmp_path, 10, 20, 1.0)
    assert run_state.read_state(tmp_path) == RunState("stopped", 10, 20, 1.0)
    run_state.begin(tmp_path)
    run_state.note_progress(tmp_path, 12, 20, 1.0)
    assert not run_state.read_state(tmp_path).killed_twice
    run_state.begin(tmp_path)
    run_state.note_progress(tmp_path, 12, 20, 1.0)
    assert run_state.read_state(tmp_path).killed_twice
    run_state.fail(tmp_path, "killed", MemoryError())
    run_state.begin(tmp_path)
    assert not run_state.read_state(tmp_path).killed_twice
    run_state.end(tmp_path)
    assert run_state.read_state(tmp_path) == RunState("missing")


def test_what_later_versions_add_to_a_status_is_left_out(tmp_path: Path) -> None:
    later = {"state": "running", "step": 3, "steps": 20, "seconds": 1.5, "died_at": None, "colour": ["red"]}
    (tmp_path / "status.json").write_text(json.dumps(later))
    assert run_state.read_state(tmp_path) == RunState("stopped", 3, 20, 1.5)


@pytest.mark.parametrize("text", ["", "[]", "null", '{"state": "runn'])
def test_a_damaged_status_counts_as_none_and_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / "status.json").write_text(text)
    found = run_state.read_state(tmp_path)
    assert replace(found, problem="") == RunState("missing")
    assert found.problem.startswith(f"{tmp_path / 'status.json'}: not a readable status: ")


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.0, "0 s"), (59.7, "1 min"), (89.0, "1 min"), (3500.0, "58 min"), (3599.0, "1:00 h"), (9e4, "25:00 h")],
)
def test_durations(seconds: float, text: str) -> None:
    assert duration(seconds) == text
