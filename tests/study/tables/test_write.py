"""Names of the tables, and the deletion of old ones."""

from pathlib import Path

from study_rows import make_row, make_tables, write


def test_one_group_has_plain_names_and_old_tables_go(tmp_path: Path) -> None:
    scores = {"cd_l1": 1.0, "miou": 1.0, "iou_0": 1.0}
    write(tmp_path, make_row("relu", **scores), make_row("relu", recipe="points", **scores))
    make_tables(tmp_path)
    tables = tmp_path / "tables"
    (tables / "mine.tex").write_text("kept")
    assert len(list(tables.glob("*--*"))) == 12
    (tmp_path / "run0001" / "result.json").unlink()
    written = make_tables(tmp_path)
    made = ("main_reconstruction", "main_segmentation", "worst", "per_part_iou", "part_count", "cost")
    names = {f"{name}.{ending}" for name in made for ending in ("csv", "tex")} | {"runs.csv", "report.tex"}
    assert {path.name for path in written} == names
    assert {path.name for path in tables.iterdir()} == names | {"mine.tex"}
