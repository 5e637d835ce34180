"""Panels of the plots: boxes by head, scatter plots, values over the number of parts."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from jointsdf.study.comparisons import Comparison
from jointsdf.study.figures.style import INK, PALE, dodge, head_style
from jointsdf.study.statistics import per_shape, summarise
from jointsdf.study.tables.columns import Column
from jointsdf.study.tables.main import PART_COUNTS

LOG_RATIO = 20  # largest over smallest value from which an axis is logarithmic
MEAN: dict[str, Any] = {"linestyle": "", "markersize": 6, "mec": INK, "mew": 0.8, "clip_on": False}
MARGIN_STEP = 0.06  # of a panel's side, between the means of two heads
POINTS: dict[str, Any] = {"linestyle": "", "alpha": 0.75, "mew": 0}
REFERENCES: dict[str, Any] = {"floor": "--", "ceiling": ":"}  # line styles


def draw_boxes(ax: Axes, comparison: Comparison, column: Column) -> None:
    """Draw a box and every shape's value per head, and the medians of floor and ceiling as lines."""
    for place, head in enumerate(comparison.heads):
        style = head_style(head, comparison.heads)
        values = np.array([*per_shape(comparison.of(head), column.metric).values()])
        values = values[~np.isnan(values)]
        ax.boxplot(
            [values],
            positions=[place],
            widths=0.7,
            showfliers=False,
            boxprops={"color": style["color"]},
            whiskerprops={"color": style["color"]},
            capprops={"color": style["color"]},
            medianprops={"color": INK, "linewidth": 1.4},
        )
        ax.plot(place + dodge(values, 0.3), values, markersize=3.2, label=head, **(style | POINTS))
    for kind, dashes in REFERENCES.items():
        name = f"{column.metric}_{kind}"
        if name in comparison.runs and comparison.runs[name].notna().any():
            median = np.nanmedian([*per_shape(comparison.runs, name).values()])
            ax.axhline(float(median), color=PALE, linestyle=dashes, linewidth=1.0, label=kind)
    ax.set_title(column.header)
    ax.set_xticks([])
    ax.grid(visible=False, axis="x")


def draw_scatter(ax: Axes, comparison: Comparison, x: Column, y: Column, *, error: bool) -> None:
    """Draw a point per head and shape.

    Args:
        ax: Panel.
        comparison: The runs.
        x: Metric across.
        y: Metric upwards.
        error: Whether to show 1 - y.
    """
    for head in comparison.heads:
        across, up = (per_shape(comparison.of(head), column.metric) for column in (x, y))
        heights = [1 - value if error else value for value in up.values()]
        style = head_style(head, comparison.heads) | POINTS
        ax.plot([*across.values()], heights, markersize=4, label=head, **style)
    ax.set_xlabel(x.name + x.unit)
    ax.set_ylabel(rf"1 $-$ {y.name}" if error else y.header)
    _log_where_wide(ax, comparison.runs[x.metric])


def draw_means(ax: Axes, comparison: Comparison, x: Column, y: Column) -> None:
    """Mark each head's means at the margins, above and to the right of the panel, in a line of its own."""
    for place, head in enumerate(comparison.heads):
        across, up = (summarise(per_shape(comparison.of(head), column.metric).values()).mean for column in (x, y))
        away = 1.03 + MARGIN_STEP * place
        style = head_style(head, comparison.heads) | MEAN
        ax.plot(across, away, transform=ax.get_xaxis_transform(), **style)
        ax.plot(away, up, transform=ax.get_yaxis_transform(), **style)


def _log_where_wide(ax: Axes, values: pd.Series) -> None:
    """Make the x axis logarithmic where positive values span more than `LOG_RATIO`."""
    present = values.dropna()
    if not present.empty and present.min() > 0 and present.max() > LOG_RATIO * present.min():
        ax.set_xscale("log")


def draw_by_parts(
    ax: Axes, values: Mapping[str, float], counts: Mapping[str, int], style: Mapping[str, Any], shift: float
) -> None:
    """Draw a head's values over the number of parts, and their mean in each range.

    Args:
        ax: Panel.
        values: Shape -> value.
        counts: Shape -> number of parts.
        style: From `head_style`.
        shift: Sideways, to keep heads apart.
    """
    places = np.array([counts[shape] for shape in values], dtype=float)
    heights = np.array([*values.values()])
    ax.plot(places + shift, heights, markersize=3.5, **{**style, **POINTS})
    for low, high in PART_COUNTS:
        inside = (places >= low) & (places <= (high or math.inf)) & ~np.isnan(heights)
        if inside.any():
            ends = [low - 0.3, (high or places.max()) + 0.3]
            ax.plot(ends, [heights[inside].mean()] * 2, color=style["color"], linestyle=style["linestyle"])
