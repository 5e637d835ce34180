"""What `python -m jointsdf.study status` shows of a study, and the rows that `results` keeps."""

import logging
from dataclasses import replace
from pathlib import Path

import pytest
from study_rows import ROW

from jointsdf.runs import status as run_state
from jointsdf.runs.csv import rows_from_csv
from jointsdf.runs.row import ResultRow, read_rows, write_row
from jointsdf.runs.status import RunState, duration
from jointsdf.study.__main__ import main as study


def place(outputs: Path, head: str, shape: str, seed: int = 0, variant: str = "base") -> Path:
    return outputs / "main" / variant / head / shape / f"seed{seed}"


def done(outputs: Path, head: str, shape: str, **where: int | str) -> ResultRow:
    folder = place(outputs, head, shape, **where)
    named = {"study": "main", "head": head, "shape": shape, **where}
    row = replace(ROW, seconds={"fit": 80.0, "total": 100.0}, **named)
    write_row(folder, row)
    return row


def shown(caplog: pytest.LogCaptureFixture, *arguments: str) -> list[str]:
    caplog.clear()
    with caplog.at_level(logging.INFO):
        assert study(arguments) == 0
    return "\n".join(caplog.messages).splitlines()


def test_every_kind_of_run_at_a_glance(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    heads, shapes = ("relu", "siren"), ("abc_0001", "abc_0002", "abc_0003", "abc_0004")
    folders = {(shape, head): place(tmp_path, head, shape) for shape in shapes for head in heads}
    run_state.plan(tmp_path / "main", folders.values())
    done(tmp_path, "relu", "abc_0001")
    done(tmp_path, "siren", "abc_0001")
    run_state.fail(folders["abc_0002", "relu"], "loss is nan", ValueError("loss is nan"))
    run_state.begin(folders["abc_0002", "siren"])
    run_state.note_progress(folders["abc_0002", "siren"], 5, 20, 1.0)
    done(tmp_path, "relu", "abc_0003")
    (folders["abc_0003", "relu"] / "result.json").write_text("{")
    running, measuring = folders["abc_0003", "siren"], folders["abc_0004", "relu"]
    with run_state.lock(running, wait=False), run_state.lock(measuring, wait=False):
        for folder, step in ((running, 150), (measuring, 600)):
            run_state.begin(folder)
            run_state.note_progress(folder, step, 600, 40.0)
        lines = shown(caplog, "status", "main", str(tmp_path))
    assert lines[0] == (
        f"{tmp_path / 'main'}: 8 runs: 2 done, 2 running, 1 failed, 1 damaged, 1 stopped, 1 missing; "
        "about 8 min left, one after the other"
    )
    assert lines[1:7] == [
        "",
        "base      relu       siren",
        "abc_0001  done       done",
        "abc_0002  failed     stopped 25%",
        "abc_0003  damaged    25%, 2 min",
        "abc_0004  measuring  -",
    ]
    assert lines[7] == f"failed: {folders['abc_0002', 'relu']}: loss is nan (traceback.txt there)"
    assert lines[8].startswith(f"damaged: {folders['abc_0003', 'relu'] / 'result.json'}: not a readable result row")
    assert len(lines) == 9


def test_a_grid_for_each_variant_and_a_column_for_each_seed(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    for variant in ("tap=1", "tap=2"):
        for seed in (0, 1):
            done(tmp_path, "siren", "part_01", variant=variant, seed=seed)
    lines = shown(caplog, "status", "main", str(tmp_path))
    assert lines[0].endswith("4 runs: 4 done")
    assert lines[1:] == [
        *("", "tap=1    siren seed0  siren seed1", "part_01  done         done"),
        *("", "tap=2    siren seed0  siren seed1", "part_01  done         done"),
    ]


def test_no_runs_is_one_line_with_the_fix(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    for command in ("status", "results"):
        caplog.clear()
        assert study([command, "main", str(tmp_path), "--results", str(tmp_path / "results")]) == 2
        (line,) = caplog.messages
        assert str(tmp_path / "main") in line
        assert "python train.py sweeps=main" in line


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


def test_committed_rows_are_those_of_the_runs_and_stay_where_a_run_is_elsewhere(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    outputs, results = tmp_path / "out", tmp_path / "results"
    command = ("results", "main", str(outputs), "--results", str(results))
    first = [done(outputs, head, "part_01") for head in ("relu", "siren")]
    done(outputs, "siren", "part_01", variant="other")
    assert shown(caplog, *command) == [f"{results / 'main' / 'runs.csv'}: 3 runs"]
    for path in outputs.glob("main/base/relu/*/*/result.json"):
        path.unlink()
    newer = replace(first[1], steps=77)
    write_row(place(outputs, "siren", "part_01"), newer)
    (place(outputs, "none", "part_01") / "result.json").parent.mkdir(parents=True)
    (place(outputs, "none", "part_01") / "result.json").write_text("{")
    lines = shown(caplog, *command)
    assert lines[-1] == f"{results / 'main' / 'runs.csv'}: 3 runs"
    assert "not a readable result row" in lines[0]
    kept = rows_from_csv((results / "main/runs.csv").read_text())
    here = read_rows(outputs)[0]
    assert sorted(kept, key=str) == sorted([first[0], *here], key=str)
