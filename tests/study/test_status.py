"""What `python -m jointsdf.study status` shows of a study."""

from pathlib import Path

import pytest
from study_rows import answer_of, place_of, write_finished

from jointsdf.runs import status as run_state
from jointsdf.runs.lock import lock
from jointsdf.runs.plan import plan
from jointsdf.study.__main__ import main as study


def test_every_kind_of_run_at_a_glance(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    heads, shapes = ("relu", "siren"), ("abc_0001", "abc_0002", "abc_0003", "abc_0004")
    folders = {(shape, head): place_of(tmp_path, head, shape) for shape in shapes for head in heads}
    plan(tmp_path / "main", folders.values())
    write_finished(tmp_path, "relu", "abc_0001")
    write_finished(tmp_path, "siren", "abc_0001")
    run_state.fail(folders["abc_0002", "relu"], "loss is nan", ValueError("loss is nan"))
    run_state.begin(folders["abc_0002", "siren"])
    run_state.note_progress(folders["abc_0002", "siren"], 5, 20, 1.0)
    write_finished(tmp_path, "relu", "abc_0003")
    (folders["abc_0003", "relu"] / "result.json").write_text("{")
    running, measuring = folders["abc_0003", "siren"], folders["abc_0004", "relu"]
    with lock(running, wait=False), lock(measuring, wait=False):
        for folder, step in ((running, 150), (measuring, 600)):
            run_state.begin(folder)
            run_state.note_progress(folder, step, 600, 40.0)
        lines = answer_of(caplog, "status", "main", str(tmp_path))
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
            write_finished(tmp_path, "siren", "part_01", variant=variant, seed=seed)
    lines = answer_of(caplog, "status", "main", str(tmp_path))
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
