"""Plots show every value of the rows, and nothing where there is none."""

import math
from dataclasses import replace

import numpy as np
import pytest
from drawings import HEADS, points, rows, texts
from matplotlib.axes import Axes
from study_rows import make_row

from jointsdf.study.collect import collect
from jointsdf.study.figures.plots import error_scatter, metric_comparison, part_count, time_quality
from jointsdf.study.figures.style import INK
from jointsdf.study.groups import Group, group_runs


def mean_places(ax: Axes) -> list[tuple[float, float]]:
    """Places of the outlined markers, two for each head."""
    return [tuple(map(float, line.get_xydata()[0])) for line in ax.lines if line.get_markeredgecolor() == INK]


def test_metric_comparison_shows_every_value_by_head(group: Group) -> None:
    drawing = metric_comparison(group)
    assert drawing is not None
    assert texts(drawing.figure) == {*HEADS, "floor", "ceiling"}
    titles = [ax.get_title() for ax in drawing.figure.axes]
    assert titles[0].startswith("CD$_{L1}$")
    assert len(titles) == 8
    for place, head in enumerate(HEADS):
        shown = points(drawing.figure, 0, head)
        assert [y for _, y in shown] == pytest.approx([0.3 + 0.1 * k + 0.01 * place for k in range(4)])
        assert all(abs(x - place) <= 0.3 for x, _ in shown)
    floor = [line for line in drawing.figure.axes[0].lines if line.get_label() == "floor"]
    assert floor[0].get_ydata()[0] == 0.25
    assert "Study main, recipe fast, variant base, built-in shapes, brep labels, protocol unit" in drawing.caption


def test_error_scatter_has_a_point_per_run(group: Group) -> None:
    drawing = error_scatter(group)
    assert drawing is not None
    paper, exact = drawing.figure.axes
    assert (paper.get_xlabel(), paper.get_ylabel()) == (r"CD$_{L1}$ ($\times 10^{-2}$)", r"1 $-$ mIoU")
    assert (exact.get_xlabel(), exact.get_ylabel()) == ("CD$_{L1}$/floor", r"1 $-$ mIoU exact")
    expected = [(0.3 + 0.1 * k, 0.1 + 0.1 * k) for k in range(4)]
    assert np.array(points(drawing.figure, 0, "relu")) == pytest.approx(np.array(expected))
    assert points(drawing.figure, 1, "siren")[0] == pytest.approx((0.31 / 0.25, 0.19))


def test_time_quality_has_each_run_and_each_mean(group: Group) -> None:
    drawing = time_quality(group)
    assert drawing is not None
    assert [x for x, _ in points(drawing.figure, 1, "siren")] == [1.0, 11.0, 21.0, 31.0]
    places = mean_places(drawing.figure.axes[1])
    assert places[::2] == [pytest.approx((15.0 + h, 1.03 + 0.06 * h)) for h in range(3)]  # above: seconds
    assert places[1::2] == [pytest.approx((1.03 + 0.06 * h, 0.8 + 0.01 * h)) for h in range(3)]  # to the right
    assert "means, at the margins" in texts(drawing.figure)
    assert "Measured on: a machine" in drawing.caption


def test_time_quality_leaves_out_the_labels_of_a_baseline_without_any() -> None:
    bare = {"miou": math.nan, "miou_exact": math.nan}
    flat = [
        replace(row, head="none", scores={"unit": row.scores["unit"] | bare}) for row in rows() if row.head == "relu"
    ]
    (group,) = group_runs(collect([*rows(), *flat]))
    drawing = time_quality(group)
    assert drawing is not None
    places = mean_places(drawing.figure.axes[1])
    assert [bool(np.isfinite(place).all()) for place in places[1::2]] == [False, True, True, True]


def test_part_count_has_a_mean_in_each_range(group: Group) -> None:
    drawing = part_count(group)
    assert drawing is not None
    places = {round(x) for x, _ in points(drawing.figure, 2, "hybrid")}
    assert places == {3, 6, 12, 20}
    bars = [line.get_ydata()[0] for line in drawing.figure.axes[2].lines if line.get_marker() in ("None", "")]
    assert sorted({round(float(y), 9) for y in bars}) == pytest.approx([0.6, 0.7, 0.8, 0.9])
    assert "parts of the ground truth" in drawing.figure.axes[0].get_xlabel()


def test_what_no_run_has_is_no_figure() -> None:
    (bare,) = group_runs(collect([make_row("relu"), make_row("siren")]))
    assert [plot(bare) for plot in (metric_comparison, error_scatter, time_quality, part_count)] == [None] * 4


def test_missing_values_are_not_drawn_as_zero() -> None:
    made = [make_row("relu", f"abc_{k}", cd_l1=value) for k, value in enumerate((0.5, math.nan, 0.7))]
    (one,) = group_runs(collect(made))
    drawing = metric_comparison(one)
    assert drawing is not None
    assert [y for _, y in points(drawing.figure, 0, "relu")] == [0.5, 0.7]
