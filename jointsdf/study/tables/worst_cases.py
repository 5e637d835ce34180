"""Worst cases: the worst shape of each metric with the mean, and the number of shapes whose counts are right."""

import math

from jointsdf.study.comparisons import Comparison, compare
from jointsdf.study.groups import Group
from jointsdf.study.missing_runs import shorten
from jointsdf.study.statistics import per_shape, summarise
from jointsdf.study.tables.columns import RIGHT, WORST, Column
from jointsdf.study.tables.latex import MISSING, cell, escape, format_number
from jointsdf.study.tables.table import Line, Table, build_block_table, measured

NAMED = 5  # shapes; of more, the number of the others


def worst(group: Group, label: str) -> Table | None:
    """Mean and worst value of each metric, with its shape, per head; then the shapes with wrong counts.

    None for a group without labels.
    """
    comparison = compare(group, baseline=False)
    if not comparison.heads:
        return None
    columns = measured(comparison, (*WORST, *RIGHT))
    lines = [_line(comparison, head, column) for column in columns for head in comparison.heads]
    what = (
        "Mean ± sample standard deviation and the worst value with its shape; below, on how many shapes pieces, Euler "
        "number (holes) and parts are as in the ground truth, and where not. "
        f"{len(comparison.shapes)} shapes that every head was run on"
    )
    return build_block_table(comparison, lines, what, label, len(comparison.heads))


def _line(comparison: Comparison, head: str, column: Column) -> Line:
    found = per_shape(comparison.of(head), column.metric)
    values = {shape: value for shape, value in found.items() if not math.isnan(value)}
    summary, pick = summarise(values.values()), max if column.goal == "low" else min
    extreme = pick(values.values(), default=math.nan)
    if column in RIGHT:
        shapes = [shape for shape, share in values.items() if share < 1]
        shown = (f"{len(values) - len(shapes)} of {len(values)}", MISSING)
    else:
        shapes = [pick(values, key=values.__getitem__)] if values else []
        mean = cell(summary, digits=column.digits, out_of=len(comparison.shapes), bold=False)
        shown = (mean, format_number(extreme, column.digits))
    numbers = {"metric": column.metric, "head": head, "n": summary.n, "mean": summary.mean, "std": summary.std}
    cells = {"Metric": column.header if head == comparison.heads[0] else "", "Head": escape(head)}
    cells[r"mean $\pm$ std"], cells["worst"] = shown if values else (MISSING, MISSING)
    cells["shapes"] = escape(shorten(shapes, shown=NAMED)) or MISSING
    return numbers | {"worst": extreme, "shapes": " ".join(shapes)}, cells
