"""Tables with a line per head, against computation by hand."""

import math
from pathlib import Path

import numpy as np
import pytest
from study_rows import NAN, line, make_row, make_tables, read_table, read_tex, values_of, write

from jointsdf.study.tables.write import write_tables


def test_reconstruction_by_hand(outputs: Path) -> None:
    table = read_table(outputs, "main_reconstruction")
    assert list(table["head"]) == ["none", "relu", "siren"]
    relu = line(table, "relu")  # abc_0001: (0.2 + 0.4) / 2 = 0.3, abc_0002: 0.5
    assert relu["n"] == 2
    assert relu["cd_l1_mean"] == pytest.approx(0.4)
    assert relu["cd_l1_std"] == pytest.approx(math.sqrt(0.02))  # (0.1^2 + 0.1^2) / (2 - 1)
    assert relu["cd_l1_over_floor_mean"] == pytest.approx(2.0)
    assert relu["nc_mean"] == pytest.approx(0.93)
    assert relu["cd_l1_n"] == 2
    assert relu["cd_l2_n"] == 0
    assert math.isnan(relu["cd_l2_mean"])
    assert line(table, "siren")["cd_l1_mean"] == pytest.approx(0.3)
    assert line(table, "none")["cd_l1_std"] == 0.0
    assert set(table["dropped_shapes"]) == {"abc_0003 abc_0004"}


def test_reconstruction_tex_marks_the_best_and_lists_the_dropped(outputs: Path) -> None:
    text = read_tex(outputs, "main_reconstruction")
    rows = {row.split(" & ")[0]: row for row in text.splitlines() if " & " in row}
    assert r"\textbf{0.300} $\pm$ 0.141" in rows["siren"]  # cd_l1: lowest, a tie with the baseline
    assert r"\textbf{0.300} $\pm$ 0.000" in rows["none"]
    assert r"0.400 $\pm$ 0.141" in rows["relu"]
    assert rows["siren"].count(r"\textbf{0.940}") == 1  # nc: highest
    assert r"\textbf{0.930}" not in text
    assert "0.200" in rows["relu"]
    assert r"\textbf{0.200}" not in text  # the floor is not a competition
    assert r"Left out: abc\_0003 (no none, siren); abc\_0004 (no none, relu)." in text
    assert "1 to 2 seeds averaged first" in text


def test_segmentation_by_hand_has_no_baseline_but_floor_and_ceiling(outputs: Path) -> None:
    table = read_table(outputs, "main_segmentation")
    assert list(table["head"]) == ["relu", "siren", "floor", "ceiling"]
    assert line(table, "relu")["miou_mean"] == pytest.approx((0.6 + 0.8) / 2)
    assert line(table, "siren")["miou_mean"] == pytest.approx(0.65)
    assert line(table, "siren")["miou_std"] == pytest.approx(math.sqrt(2 * 0.25**2))
    assert line(table, "floor")["miou_mean"] == pytest.approx(0.9)
    assert line(table, "floor")["miou_exact_n"] == 0
    assert line(table, "ceiling")["miou_exact_mean"] == pytest.approx(0.98)
    assert line(table, "ceiling")["miou_n"] == 0
    text = read_tex(outputs, "main_segmentation")
    assert r"\textit{floor or ceiling} & 2 & 0.900 $\pm$ 0.000 \\" in text, "no head has another metric"
    assert r"relu & 2 & \textbf{0.700} $\pm$ 0.141" in text


def test_no_cell_of_the_references_is_blank(tmp_path: Path) -> None:
    exact = {"miou_exact": 0.9, "miou_exact_ceiling": 0.98}
    write(tmp_path, make_row("relu", miou=0.7, miou_floor=0.8, **exact))
    make_tables(tmp_path)
    text = read_tex(tmp_path, "main_segmentation")
    assert r"\textit{floor or ceiling} & 1 & 0.800 & 0.980 (c) \\" in text


def test_per_part_iou_is_over_the_shapes_that_have_the_part(outputs: Path) -> None:
    table = read_table(outputs, "per_part_iou")
    relu = table[table["head"] == "relu"].set_index("part")
    assert list(relu["n"]) == [2, 1]
    assert relu.loc[0, "iou_mean"] == pytest.approx((0.5 + 0.8) / 2)
    assert relu.loc[0, "iou_std"] == pytest.approx(math.sqrt(2 * 0.15**2))
    assert relu.loc[1, "iou_mean"] == pytest.approx(0.7)
    assert math.isnan(relu.loc[1, "iou_std"])
    assert "none" not in set(table["head"])
    text = read_tex(outputs, "per_part_iou")
    assert r"$P_{0}$ & 2 & 0.65 $\pm$ 0.21 & 0.65 $\pm$ 0.35" in text.replace(r"\textbf{0.65}", "0.65")
    assert r"$P_{1}$ & 1 & 0.70 & \textbf{0.90}" in text


def test_a_part_that_no_shape_has_is_dashes(tmp_path: Path) -> None:
    write(tmp_path, make_row("relu", miou=1.0, iou_0=1.0, iou_2=0.5))
    make_tables(tmp_path)
    assert r"$P_{1}$ & 0 & --" in read_tex(tmp_path, "per_part_iou")
    assert read_table(tmp_path, "per_part_iou")["n"].tolist() == [1, 0, 1]


def test_part_ids_far_apart_are_listed_alone(tmp_path: Path) -> None:
    write(tmp_path, make_row("relu", miou=1.0, iou_7=1.0, iou_100000=0.5))
    make_tables(tmp_path)
    assert read_table(tmp_path, "per_part_iou")["part"].tolist() == [7, 100000]


def test_spread_of_seeds_is_pooled_over_the_shapes_with_several(tmp_path: Path) -> None:
    seeds = {"abc_0001": (0.5, 0.7), "abc_0002": (0.1, 0.2, 0.6), "abc_0003": (9.0,), "abc_0004": (0.5, NAN)}
    rows = [make_row("siren", s, k, miou=v) for s, line in seeds.items() for k, v in enumerate(line)]
    write(tmp_path, *rows, make_row("relu", "abc_0005", 0, miou=0.5), make_row("relu", "abc_0005", 1, miou=0.5))
    make_tables(tmp_path)
    assert line(read_table(tmp_path, "seeds"), "relu")["miou_std"] == 0
    assert "2 to 3 seeds." in read_tex(tmp_path, "seeds")
    found = line(read_table(tmp_path, "seeds"), "siren")
    squares = [np.var(values, ddof=1) * (len(values) - 1) for values in (seeds["abc_0001"], seeds["abc_0002"])]
    assert found["miou_std"] == pytest.approx(math.sqrt(sum(squares) / 3))
    assert (found["miou_n"], found["nc_n"]) == (2, 0)
    assert math.isnan(found["nc_std"])


def test_part_counts_by_hand(eight: Path) -> None:
    table = read_table(eight, "part_count").set_index(["parts", "head"])
    assert list(table.index.get_level_values("parts").unique()) == ["2-4", "5-8", "9-18", ">18"]
    assert set(table["n"]) == {2}
    cd_l1 = values_of(eight, "siren", "cd_l1")
    for place, parts in enumerate(("2-4", "5-8", "9-18", ">18")):
        assert table.loc[(parts, "siren"), "cd_l1_mean"] == pytest.approx(cd_l1[2 * place : 2 * place + 2].mean())
    assert r"$>$" not in read_tex(eight, "part_count")
    assert r"\textgreater{}18" in read_tex(eight, "part_count")


def test_cost_names_the_machine(eight: Path) -> None:
    table = read_table(eight, "cost")
    assert set(table["seconds_fit_mean"]) == {2.5}
    assert set(table["peak_memory_mb_mean"]) == {100.0}
    assert "Measured on: a machine; on cpu; threads: 2." in read_tex(eight, "cost")


def test_a_thousand_runs_are_counted_by_shape(tmp_path: Path) -> None:
    scores = {f"iou_{part}": 0.5 for part in range(18)} | {"cd_l1": 0.3, "nc": 0.9, "miou": 0.8}
    heads = ("none", "relu", "siren", "hybrid", "deep_skip")
    rows = [make_row(head, f"abc_{k:04d}", seed, **scores) for head in heads for k in range(50) for seed in range(4)]
    write_tables(rows, tmp_path, tmp_path)
    assert line(read_table(tmp_path, "main_segmentation"), "hybrid")["n"] == 50


def test_distance_by_hand_and_only_of_rows_that_have_it(tmp_path: Path) -> None:
    scores = {"cd_l1": 1.0, "sdf_relative_mean": 0.01, "sdf_ratio": 0.99, "overshoot": 0.002}
    write(tmp_path, make_row("relu", **scores), make_row("relu", "abc_0002", **scores | {"sdf_relative_mean": 0.03}))
    make_tables(tmp_path)
    relu = line(read_table(tmp_path, "distance"), "relu")
    assert (relu["sdf_relative_mean_mean"], relu["sdf_ratio_mean"]) == pytest.approx((0.02, 0.99))
    assert relu["gradient_angle_median_n"] == 0
    assert r"relu & 2 & 0.0200 $\pm$ 0.0141" in read_tex(tmp_path, "distance")
    (tmp_path / "without").mkdir()
    write(tmp_path / "without", make_row("relu", cd_l1=1.0))
    assert not any(path.stem == "distance" for path in make_tables(tmp_path / "without"))


def test_edges_by_hand_with_their_ceiling_and_only_of_rows_that_have_them(tmp_path: Path) -> None:
    scores = {"cd_l1": 1.0, "edge_f1_fine": 0.6, "edge_f1_fine_ceiling": 0.8, "crease_angle_error": 30.0}
    smooth = {"cd_l1": 1.0, "edge_f1_fine": NAN, "false_crease_length": 0.5}
    rows = make_row("relu", **scores), make_row("relu", "abc_0002", **scores | {"edge_f1_fine": 0.7})
    write(tmp_path, *rows, make_row("relu", "abc_0003", **smooth))
    make_tables(tmp_path)
    table = read_table(tmp_path, "edges")
    relu, ceiling = line(table, "relu"), line(table, "ceiling")
    assert (relu["edge_f1_fine_mean"], relu["edge_f1_fine_n"], relu["n"]) == pytest.approx((0.65, 2, 3))
    assert (relu["crease_angle_error_mean"], relu["false_crease_length_mean"]) == (30.0, 0.5)
    assert (ceiling["edge_f1_fine_mean"], ceiling["edge_f1_fine_n"]) == (0.8, 2)
    worst = read_table(tmp_path, "worst").set_index("metric").loc["edge_f1_fine_over_ceiling"]
    assert (worst["worst"], worst["shapes"]) == (pytest.approx(0.75), "abc_0001")
    (tmp_path / "without").mkdir()
    write(tmp_path / "without", make_row("relu", cd_l1=1.0))
    assert not any(path.stem == "edges" for path in make_tables(tmp_path / "without"))
