"""The worst shape of each metric beside the mean, and on how many shapes a count is right."""

import math
from collections.abc import Mapping

from jointsdf.study.columns import RIGHT, WORST, Column
from jointsdf.study.gaps import shortened
from jointsdf.study.groups import Comparison, Group, compare
from jointsdf.study.latex import MISSING, cell, escape, number
from jointsdf.study.statistics import per_shape, summarise
from jointsdf.study.table import Line, Table, in_blocks

NAMED = 5  # shapes; of more, the number of the others


def worst(group: Group, label: str) -> Table | None:
    """Mean and worst value of each metric, with its shape, per head; then the shapes whose counts are wrong.

    None for a group without labels.
    """
    comparison = compare(group, baseline=False)
    if not comparison.heads:
        return None
    lines = [_worst_line(comparison, head, column) for column in WORST for head in comparison.heads]
    lines += [_right_line(comparison, head, column) for column in RIGHT for head in comparison.heads]
    what = (
        "Mean ± sample standard deviation and the worst value with its shape; below, on how many shapes pieces, Euler "
        "number (holes) and parts are as in the ground truth, and where not. "
        f"{len(comparison.shapes)} shapes that every head was run on"
    )
    return in_blocks(comparison, lines, what, label, len(comparison.heads))


def _worst_line(comparison: Comparison, head: str, column: Column) -> Line:
    values = _present(per_shape(comparison.of(head), column.metric))
    summary = summarise(values.values())
    shape = (max if column.goal == "low" else min)(values, key=values.__getitem__) if values else ""
    extreme = values.get(shape, math.nan)
    numbers = {"metric": column.metric, "head": head, "n": summary.n, "mean": summary.mean, "std": summary.std}
    mean = cell(summary, digits=column.digits, out_of=len(comparison.shapes), bold=False)
    found = number(extreme, column.digits) if values else MISSING
    cells = _cells(comparison, head, column, (mean, found, escape(shape) or MISSING))
    return numbers | {"worst": extreme, "shapes": shape}, cells


def _right_line(comparison: Comparison, head: str, column: Column) -> Line:
    values = _present(per_shape(comparison.of(head), column.metric))
    wrong = [shape for shape, share in values.items() if share < 1]
    summary = summarise(values.values())
    numbers = {"metric": column.metric, "head": head, "n": summary.n, "mean": summary.mean, "std": summary.std}
    count = f"{len(values) - len(wrong)} of {len(values)}" if values else MISSING
    cells = _cells(comparison, head, column, (count, MISSING, escape(shortened(wrong, shown=NAMED)) or MISSING))
    return numbers | {"worst": min(values.values(), default=math.nan), "shapes": " ".join(wrong)}, cells


def _cells(comparison: Comparison, head: str, column: Column, rest: tuple[str, str, str]) -> dict[str, str]:
    cells = {"Metric": column.header if head == comparison.heads[0] else "", "Head": escape(head)}
    return cells | dict(zip((r"mean $\pm$ std", "worst", "shapes"), rest, strict=True))


def _present(values: Mapping[str, float]) -> dict[str, float]:
    return {shape: value for shape, value in values.items() if not math.isnan(value)}
