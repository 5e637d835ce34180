"""Planned runs without a result are named in the caption."""

from pathlib import Path

from study_rows import make_row, make_tables, read_tex

from jointsdf.runs import status as run_state
from jointsdf.runs.plan import plan
from jointsdf.runs.row import write_row
from jointsdf.study.__main__ import main


def test_a_head_without_any_result_is_named(tmp_path: Path) -> None:
    folders = [tmp_path / "fast" / "base" / head / "abc_0001" / "seed0" for head in ("relu", "siren")]
    plan(tmp_path / "fast", folders)
    write_row(folders[0], make_row("relu", "abc_0001", nc=0.5))
    (folders[1]).mkdir(parents=True)
    (folders[1] / "result.json").write_text("{")
    make_tables(tmp_path)
    assert r"siren on abc\_0001 (seed0, its result cannot be read)." in read_tex(tmp_path, "main_reconstruction")
    assert main(["tables", str(tmp_path), "--results", str(tmp_path / "none"), "--heads", "relu"]) == 0
    assert "siren" not in read_tex(tmp_path, "main_reconstruction")


def test_failed_and_missing_runs_are_in_the_caption(tmp_path: Path) -> None:
    folders = [
        tmp_path / "main" / "base" / head / f"abc_000{k}" / "seed0" for head in ("relu", "siren") for k in (1, 2)
    ]
    plan(tmp_path / "main", folders)
    write_row(folders[0], make_row("relu", "abc_0001", study="main", cd_l1=0.5))
    write_row(folders[2], make_row("siren", "abc_0001", study="main", cd_l1=0.5))
    run_state.fail(folders[1], "no memory", MemoryError("no memory"))
    make_tables(tmp_path)
    text = read_tex(tmp_path, "main_reconstruction")
    assert "relu on abc\\_0002 (seed0, failed: no memory), siren on abc\\_0002 (seed0, missing)." in text
