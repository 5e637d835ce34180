"""Our means next to the paper's."""

from pathlib import Path

import pytest
from study_rows import make_row, make_tables, read_table, read_tex, results_with_the_paper, values_of, write


def test_against_paper_has_both_numbers_and_names_both_origins(eight: Path) -> None:
    table = read_table(eight, "against_paper").set_index(["metric", "head"])
    hybrid, relu = table.loc[("cd_l1", "hybrid")], table.loc[("cd_l1", "relu")]
    assert (relu["paper_mean"], relu["paper_std"], relu["floor_mean"]) == (0.59, 1.30, 0.25)
    assert relu["mean"] == pytest.approx(values_of(eight, "relu", "cd_l1").mean())
    assert (hybrid["paper_mean"], hybrid["n"]) == (0.49, 0)
    assert table.loc[("consistency", "siren"), "paper_mean"] == 0.97
    text = read_tex(eight, "against_paper")
    for said in ("PartField labels", "protocol unit", "recipe fast", "brep labels", "ABC shapes", r"0.59 $\pm$ 1.30"):
        assert said in text


def test_built_in_shapes_are_not_held_against_the_paper(tmp_path: Path) -> None:
    write(tmp_path, make_row("relu", "part_01", cd_l1=1.0), make_row("siren", "part_01", cd_l1=1.0))
    assert not [
        path for path in make_tables(tmp_path, results_with_the_paper(tmp_path)) if "against_paper" in path.name
    ]
