"""The worst shape of each metric."""

from pathlib import Path

import pytest
from study_rows import NAN, make_row, make_tables, read_table, read_tex, write

from jointsdf.runs.row import ResultRow


def test_worst_names_the_shape_by_the_metrics_own_direction(tmp_path: Path) -> None:
    def run(head: str, k: int, cd_l1: float, nc: float, pieces: float) -> ResultRow:
        floors = {"cd_l1_floor": 0.5, "nc_floor": 0.75}
        return make_row(head, f"abc_000{k}", cd_l1=cd_l1, nc=nc, components=pieces, components_gt=1.0, **floors)

    write(
        tmp_path,
        *(run("relu", 1, 1.0, 0.5, 1.0), run("relu", 2, 1.5, 0.75, 2.0), run("relu", 3, NAN, 0.25, 3.0)),
        *(run("siren", k, 0.5, 1.0, 1.0) for k in (1, 2, 3)),
    )
    make_tables(tmp_path)
    table = read_table(tmp_path, "worst").set_index(["metric", "head"])
    facts = ["n", "mean", "worst", "shapes"]
    assert table.loc[("cd_l1_over_floor", "relu"), facts].tolist() == [2, 2.5, 3.0, "abc_0002"]
    assert table.loc[("nc_minus_floor", "relu"), facts].tolist() == [3, -0.25, -0.5, "abc_0003"]
    assert table.loc[("pieces_right", "relu"), facts].tolist() == [3, pytest.approx(1 / 3), 0.0, "abc_0002 abc_0003"]
    assert table.loc[("pieces_right", "siren"), ["n", "mean", "worst"]].tolist() == [3, 1.0, 1.0]
    assert not {"parts_right", "acc_exact"} & set(table.index.get_level_values("metric")), "no run has them"
    text = read_tex(tmp_path, "worst")
    assert r"relu & 1 of 3 & -- & abc\_0002, abc\_0003" in text
    assert "siren & 3 of 3 & -- & --" in text
