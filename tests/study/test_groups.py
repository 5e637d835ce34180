"""Runs that are not comparable are never in one table."""

from pathlib import Path

import pytest
from study_rows import NAN, line, make_row, make_tables, read_table, write


@pytest.mark.parametrize(
    ("changed", "name"),
    [
        ({"study": "wide"}, "wide/main_reconstruction"),
        ({"recipe": "points"}, "fast/main_reconstruction--fast-points-base-abc-brep-unit"),
        (
            {"variant": "loss.weights.weingarten=0"},
            "fast/main_reconstruction--fast-loss.weights.weingarten=0-abc-brep-unit",
        ),
        ({"provider": "file:labels.npy"}, "fast/main_reconstruction--fast-base-abc-file-unit"),
        ({"shape": "part_01"}, "fast/main_reconstruction--fast-base-builtin-brep-unit"),
        ({"protocol": "flatcad"}, "fast/main_reconstruction--fast-base-abc-brep-flatcad"),
    ],
)
def test_what_differs_is_never_in_one_table(tmp_path: Path, changed: dict[str, str], name: str) -> None:
    other = {"shape": "abc_0009", **changed}
    write(
        tmp_path,
        make_row("relu", "abc_0001", cd_l1=1.0),
        make_row("relu", "abc_0002", cd_l1=3.0, provider="brep:as-is"),
        make_row("relu", cd_l1=100.0, **other),  # type: ignore[arg-type]
    )
    make_tables(tmp_path)
    assert line(read_table(tmp_path, "fast/main_reconstruction"), "relu")["cd_l1_mean"] == 2.0
    assert line(read_table(tmp_path, name), "relu")["cd_l1_mean"] == 100.0
    assert len(list((tmp_path / "tables").rglob("main_reconstruction*.tex"))) == 2


def test_the_default_group_is_protocol_unit_however_few_its_rows(tmp_path: Path) -> None:
    flatcad = [make_row("relu", f"abc_000{k}", cd_l1=5.0, protocol="flatcad") for k in (2, 3)]
    write(tmp_path, make_row("relu", "abc_0001", cd_l1=1.0), *flatcad)
    make_tables(tmp_path)
    assert line(read_table(tmp_path, "main_reconstruction"), "relu")["protocol"] == "unit"


def test_the_baseline_alone_has_tables_of_reconstruction_only(tmp_path: Path) -> None:
    write(tmp_path, make_row("none", cd_l1=1.0, miou=NAN))
    made = {path.name for path in make_tables(tmp_path)}
    names = {f"{name}.{ending}" for name in ("main_reconstruction", "cost") for ending in ("csv", "tex")}
    assert made == names | {"runs.csv", "report.tex"}
