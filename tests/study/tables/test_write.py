"""Names of the tables, and the deletion of old ones."""

from pathlib import Path

from study_rows import make_row, make_tables, write


def test_one_group_has_plain_names_and_old_tables_go(tmp_path: Path) -> None:
    scores = {"cd_l1": 1.0, "miou": 1.0, "iou_0": 1.0}
    write(tmp_path, make_row("relu", **scores), make_row("relu", recipe="points", **scores))
    make_tables(tmp_path)
    tables = tmp_path / "tables"
    (tables / "mine.tex").write_text("kept")
    assert len(list(tables.glob("fast/*--*"))) == 12
    (tmp_path / "run0001" / "result.json").unlink()
    written = make_tables(tmp_path)
    made = ("main_reconstruction", "main_segmentation", "worst", "per_part_iou", "part_count", "cost")
    names = {f"{name}.{ending}" for name in made for ending in ("csv", "tex")} | {"runs.csv", "report.tex"}
    assert {path.name for path in written} == names
    assert {path.name for path in tables.rglob("*.*")} == names | {"mine.tex"}
    assert {path.name for path in tables.iterdir()} == {"fast", "runs.csv", "report.tex", "mine.tex"}


def test_each_study_has_a_folder_which_goes_with_its_rows(tmp_path: Path) -> None:
    write(
        tmp_path, *(make_row("relu", f"abc_000{k}", nc=1.0) for k in (1, 2)), make_row("siren", study="wide b", nc=1.0)
    )
    tables = tmp_path / "tables"
    tables.mkdir()
    (tables / "cost--wide-fast-base-abc-brep-unit.csv").write_text("of the layout before")
    make_tables(tmp_path)
    assert {path.name for path in tables.iterdir()} == {"fast", "wide-b", "runs.csv", "report.tex"}
    labels = [
        path.read_text().count(rf"\label{{tab:{name}}}")
        for path, name in ((tables / "fast" / "worst.tex", "worst"), (tables / "wide-b" / "worst.tex", "worst--wide-b"))
    ]
    assert labels == [1, 1]
    assert r"\graphicspath{{../figures/wide-b/}}" in (tables / "report.tex").read_text()
    (tmp_path / "run0002" / "result.json").unlink()
    make_tables(tmp_path)
    assert {path.name for path in tables.iterdir()} == {"fast", "runs.csv", "report.tex"}
