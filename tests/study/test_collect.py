"""Rows as one table in memory, of runs and of committed files."""

import math
from pathlib import Path

import pytest
from study_rows import NAN, make_row, write

from jointsdf.runs.csv import read_committed, rows_to_csv
from jointsdf.runs.row import ResultRow
from jointsdf.study.collect import collect, load_rows


def test_collect_gives_one_line_per_run_and_protocol() -> None:
    row = make_row(cd_l1=0.5, cd_l1_floor=0.25, iou_10=0.5, iou_9=0.25, nc=0.9)
    both = ResultRow(**{**vars(row), "scores": {"unit": row.scores["unit"], "flatcad": {"cd_l1": 0.75}}})
    table = collect([both, make_row(head="deep_skip", cd_l1=1.0, cd_l1_floor=0.0)])
    assert list(table["protocol"]) == ["flatcad", "unit", "unit"]
    assert list(table["head"]) == ["relu", "deep_skip", "relu"]
    unit = table.iloc[2]
    assert unit["cd_l1_over_floor"] == 2.0
    assert table["cd_l1_over_floor"].isna().tolist() == [True, True, False]  # no floor, floor 0
    assert (unit["seconds_fit"], unit["faces_pred"], unit["versions.torch"]) == (2.5, 100, "2.13.0")
    assert (unit["source"], unit["label_provider"], unit["status"], unit["steps"]) == ("abc", "brep", "ok", 10)
    columns = list(table.columns)
    assert columns[:5] == ["study", "variant", "recipe", "protocol", "head"]
    assert columns.index("nc") < columns.index("iou_9") < columns.index("iou_10") < columns.index("seconds_fit")


def test_a_mesh_without_labels_has_no_right_number_of_parts() -> None:
    counts = {"parts_pred": 0.0, "parts_gt": 3.0, "components": 1.0, "components_gt": 1.0}
    rows = [make_row("none", miou=NAN, **counts), make_row("siren", miou=0.0, **counts)]
    table = collect(rows).set_index("head")
    assert math.isnan(table.loc["none", "parts_right"])
    assert table.loc["siren", "parts_right"] == 0
    assert table["pieces_right"].tolist() == [1, 1]


def test_a_run_without_scores_keeps_its_line() -> None:
    row = ResultRow(**{**vars(make_row(status="empty_mesh")), "scores": {}})
    table = collect([row])
    assert (table.loc[0, "protocol"], table.loc[0, "status"]) == ("unit", "empty_mesh")


def test_committed_rows_fill_what_is_not_on_disk(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    outputs, results = tmp_path / "outputs", tmp_path / "results"
    write(outputs, make_row("relu", nc=0.9))
    for name, content in (
        ("fast", rows_to_csv([make_row("relu", nc=0.1), make_row("siren", nc=0.2)])),
        ("damaged", "study,head"),
    ):
        (results / name).mkdir(parents=True)
        (results / name / "runs.csv").write_text(content)
    rows = {row.head: row.scores["unit"]["nc"] for row in load_rows(outputs, results)[0]}
    assert rows == {"relu": 0.9, "siren": 0.2}
    assert f"{results / 'damaged' / 'runs.csv'}: line 1: no column variant" in caplog.text
    assert len(read_committed(tmp_path / "nowhere")[0]) == 0
    assert len(load_rows(tmp_path / "nowhere", results)[0]) == 2
    assert len(load_rows(tmp_path / "nowhere", results, every_study=False)[0]) == 2, "no finished run: as committed"
    (results / "other").mkdir()
    (results / "other" / "runs.csv").write_text(rows_to_csv([make_row("siren", study="other")]))
    assert {row.study for row in load_rows(outputs, results)[0]} == {"fast", "other"}
    assert {row.study for row in load_rows(outputs, results, every_study=False)[0]} == {"fast"}
