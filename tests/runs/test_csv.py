import math
from pathlib import Path

import pytest
from study_rows import NAN, make_row, write

from jointsdf.runs.csv import read_committed, rows_from_csv, rows_to_csv
from jointsdf.runs.row import ResultRow, read_rows


def same(left: ResultRow, right: ResultRow) -> bool:
    """Equality with NaN equal to itself."""
    return repr(sorted_dicts(vars(left))) == repr(sorted_dicts(vars(right)))


def sorted_dicts(value: object) -> object:
    return {key: sorted_dicts(value[key]) for key in sorted(value)} if isinstance(value, dict) else value


def changed(row: ResultRow, **fields: object) -> ResultRow:
    return ResultRow(**{**vars(row), **fields})


FACTS = {
    "commit": "123e4567",
    "config_hash": "1234567890123456",
    "dirty": False,
    "threads": 2,
    "ratio": 0.1,
    "empty": "",
    "word": "true",
    "null": "null",
    "quoted": '"so", he said',
    "lines": "two\nlines",
    "nothing": {},
    "versions": {"torch": "2.13.0+cpu", "scikit-image": "0.26.0", "numpy": "2.4"},
    "label_provider": "brep",
}


def test_every_column_comes_back() -> None:
    scores = {"unit": {"cd_l1": 0.1 + 0.2, "iou_10": 1e-17, "iou_9": NAN}, "flatcad": {"cd_l1": 1.0}}
    rows = [
        changed(make_row("relu", parts=7), scores=scores, provenance=FACTS, seconds={"fit": 1.5, "total": 2.0}),
        changed(make_row("siren", status="empty_mesh"), scores={"unit": {"cd_l1": NAN}}, peak_memory_mb=NAN),
        changed(make_row("siren", shape="part_01", seed=12), scores={}, counts={"parameters_trunk": 3}, seconds={}),
        changed(make_row("relu", study="alone", variant="loss.weights.weingarten=0"), scores=scores),
    ]
    back = rows_from_csv(rows_to_csv(rows))
    assert len(back) == len(rows)
    for row in rows:
        assert sum(same(row, other) for other in back) == 1
    assert rows_to_csv(back) == rows_to_csv(rows)


def test_one_line_per_run_and_protocol_in_a_fixed_order() -> None:
    row = changed(make_row("relu"), scores={"unit": {"nc": 1.0}, "flatcad": {"nc": 0.5}})
    lines = rows_to_csv([row, make_row("deep_skip", nc=0.25)]).splitlines()
    assert [line.split(",")[3:5] for line in lines[1:]] == [
        ["flatcad", "relu"],
        ["unit", "deep_skip"],
        ["unit", "relu"],
    ]
    assert rows_to_csv([]) == ""
    assert "\r" not in rows_to_csv([row])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("peak_memory_mb", "memory", "no column peak_memory_mb"),
        (",1,brep", ",0,brep", "schema 0 is older than 1"),
        (",1,brep", ",2,brep", "schema 2 is newer than 1: update jointsdf"),
        ("0.75", "many", "could not convert string to float"),
        ("abc_0001,0,abc", "abc_0001,0", "shorter"),
    ],
)
def test_what_is_not_such_a_table_is_one_line(old: str, new: str, said: str) -> None:
    text = rows_to_csv([make_row(nc=0.75)])
    assert old in text
    with pytest.raises(ValueError, match=said) as caught:
        rows_from_csv(text.replace(old, new))
    assert "\n" not in str(caught.value)
    assert "write the file again from its runs" in str(caught.value)


def test_two_lines_of_one_run_must_agree() -> None:
    header, line = rows_to_csv([make_row(nc=0.75)]).splitlines()
    for second in (line, line.replace("unit", "flatcad").replace("a machine", "another")):
        with pytest.raises(ValueError, match=r"line 3: contradicts an earlier line of the same run"):
            rows_from_csv("\n".join([header, line, second]))
    both = rows_from_csv("\n".join([header, line, line.replace("unit", "flatcad")]))
    assert both[0].scores == {"unit": {"nc": 0.75}, "flatcad": {"nc": 0.75}}


def test_the_committed_rows_of_this_repository_are_read(tmp_path: Path) -> None:
    rows, problems = read_committed(Path(__file__).parents[2] / "results")
    assert problems == []
    assert len(rows) >= 140
    row = next(row for row in rows if (row.study, row.head, row.shape) == ("main", "siren", "abc_0049"))
    assert set(row.scores) == {"unit", "flatcad"}
    assert row.provenance["versions"]["torch"] == "2.13.0+cpu"
    assert not math.isnan(row.seconds["fit"])
    write(tmp_path, row)
    assert read_rows(tmp_path)[0] == [row]
