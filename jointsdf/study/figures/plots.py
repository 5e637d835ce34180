"""Plots of the rows: metrics by head, against each other, against time and against the number of parts."""

import matplotlib as mpl
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from jointsdf.study.captions import caption, describe_machines
from jointsdf.study.comparisons import Comparison, compare
from jointsdf.study.figures.panels import MEAN, REFERENCES, draw_boxes, draw_by_parts, draw_means, draw_scatter
from jointsdf.study.figures.style import PALE, STYLE, Drawing, add_legend, head_style, make_panels
from jointsdf.study.groups import Group
from jointsdf.study.statistics import per_shape
from jointsdf.study.tables.columns import (
    ACC,
    CD_L1,
    CD_L1_OVER_FLOOR,
    CONSISTENCY,
    F1,
    MIOU,
    MIOU_EXACT,
    NC,
    SECONDS,
    Column,
)

COMPARED = (CD_L1, CD_L1_OVER_FLOOR, NC, F1, MIOU, MIOU_EXACT, ACC, CONSISTENCY)
ERRORS = ((CD_L1, MIOU), (CD_L1_OVER_FLOOR, MIOU_EXACT))
QUALITY = (CD_L1_OVER_FLOOR, MIOU_EXACT)
BY_PARTS = (CD_L1_OVER_FLOOR, NC, MIOU, MIOU_EXACT)


def metric_comparison(group: Group) -> Drawing | None:
    """Each metric by head: a box and every shape's value, the median floor or ceiling as a line."""
    comparison = compare(group, baseline=True)
    columns = [column for column in COMPARED if _has(comparison, column)]
    if not columns or not comparison.shapes:
        return None
    with mpl.rc_context(STYLE):
        figure, axes = make_panels(-(-len(columns) // 4), 4, 0.35 + 1.75 * -(-len(columns) // 4))
        for ax, column in zip(axes, columns, strict=False):
            draw_boxes(ax, comparison, column)
        for ax in axes[len(columns) :]:
            ax.set_axis_off()
        shown = {str(line.get_label()) for ax in axes for line in ax.lines}
        others = [Line2D([], [], color=PALE, linestyle=REFERENCES[kind], label=kind) for kind in REFERENCES]
        add_legend(figure, comparison.heads, others=[line for line in others if line.get_label() in shown])
    what = (
        f"Metrics by head on the {len(comparison.shapes)} shapes that every head was run on: each point a shape, box: "
        "quartiles and median, whiskers to 1.5 interquartile ranges; dashed: median of the floor (the ground truth "
        "against itself), dotted: median of the ceiling (what grid and face rule alone cost)"
    )
    return Drawing(figure, caption(what, comparison, unequal=False))


def error_scatter(group: Group) -> Drawing | None:
    """Segmentation error over reconstruction error, a point per head and shape."""
    comparison = compare(group, baseline=False)
    pairs = [(x, y) for x, y in ERRORS if _has(comparison, x) and _has(comparison, y)]
    if not pairs:
        return None
    with mpl.rc_context(STYLE):
        figure, axes = make_panels(1, len(pairs), 2.9)
        for ax, (x, y) in zip(axes, pairs, strict=True):
            draw_scatter(ax, comparison, x, y, error=True)
        add_legend(figure, comparison.heads)
    what = f"Segmentation error over reconstruction error, a point per head and shape ({len(comparison.shapes)} shapes)"
    return Drawing(figure, caption(what, comparison, unequal=False))


def time_quality(group: Group) -> Drawing | None:
    """Quality over the seconds of a run: a point per head and shape, each head's means at the margins."""
    comparison = compare(group, baseline=True)
    columns = [column for column in QUALITY if _has(comparison, column)]
    if not columns or not _has(comparison, SECONDS):
        return None
    with mpl.rc_context(STYLE):
        figure, axes = make_panels(1, len(columns), 2.9)
        for ax, column in zip(axes, columns, strict=True):
            draw_scatter(ax, comparison, SECONDS, column, error=False)
            draw_means(ax, comparison, SECONDS, column)
        means = Line2D([], [], **(MEAN | {"color": "white", "marker": "o"}), label="means, at the margins")
        add_legend(figure, comparison.heads, others=[means])
    what = (
        "Quality over the seconds of a whole run, a point per head and shape; outlined, above and to the right: each "
        "head's mean. "
        f"{describe_machines(comparison.runs)}"
    )
    return Drawing(figure, caption(what, comparison, unequal=False))


def part_count(group: Group) -> Drawing | None:
    """Metrics over the number of parts, with each head's mean in the ranges of the table."""
    comparison = compare(group, baseline=False)
    columns = [column for column in BY_PARTS if _has(comparison, column)]
    if not columns:
        return None
    counts = {str(shape): int(parts) for shape, parts in comparison.runs.groupby("shape")["num_parts"].max().items()}
    with mpl.rc_context(STYLE):
        figure, axes = make_panels(-(-len(columns) // 2), 2, 0.35 + 2.1 * -(-len(columns) // 2))
        for ax, column in zip(axes, columns, strict=False):
            for place, head in enumerate(comparison.heads):
                shift = 0.14 * (place - (len(comparison.heads) - 1) / 2)
                draw_by_parts(
                    ax, per_shape(comparison.of(head), column.metric), counts, head_style(head, comparison.heads), shift
                )
            ax.set_xlabel("parts of the ground truth")
            ax.set_ylabel(column.header)
            ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        for ax in axes[len(columns) :]:
            ax.set_axis_off()
        add_legend(figure, comparison.heads)
    what = (
        f"Metrics over the number of parts of the {len(comparison.shapes)} shapes that every head was run on: a point "
        "per head and shape, bars: means over 2-4, 5-8, 9-18 and more than 18 parts"
    )
    return Drawing(figure, caption(what, comparison, unequal=False))


def _has(comparison: Comparison, column: Column) -> bool:
    return column.metric in comparison.runs and bool(comparison.runs[column.metric].notna().any())


PLOTS = {
    "metric_comparison": metric_comparison,
    "error_scatter": error_scatter,
    "time_quality": time_quality,
    "part_count_plot": part_count,
}
