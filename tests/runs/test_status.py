"""Run status on disk: the plan of a study, progress, and failures."""

from pathlib import Path

import pytest

from jointsdf.runs import status as run_state
from jointsdf.runs.status import RunState, duration


def test_wanted_runs_add_up_in_their_order(tmp_path: Path) -> None:
    main = tmp_path / "main"
    run_state.plan(main, [main / "b", main / "a"])
    run_state.plan(main, [main / "c", main / "b"])
    assert run_state.planned_runs(main) == [main / "b", main / "a", main / "c"]
    (main / "sweep.json").write_text("{")
    assert run_state.planned_runs(main) == []


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


@pytest.mark.parametrize("text", ["", "[]", "null", '{"state": "runn'])
def test_a_damaged_status_is_none(tmp_path: Path, text: str) -> None:
    (tmp_path / "status.json").write_text(text)
    assert run_state.read_state(tmp_path) == RunState("missing")


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.0, "0 s"), (59.7, "1 min"), (89.0, "1 min"), (3500.0, "58 min"), (3599.0, "1:00 h"), (9e4, "25:00 h")],
)
def test_durations(seconds: float, text: str) -> None:
    assert duration(seconds) == text
