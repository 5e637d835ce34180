"""Parts common to all tables: numbers for CSV with cells for LaTeX, and summaries of a head."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from jointsdf.study.captions import caption
from jointsdf.study.comparisons import Comparison
from jointsdf.study.statistics import Summary, per_shape, shape_means, summarise
from jointsdf.study.tables.columns import Column
from jointsdf.study.tables.latex import Goal, cell, mark_best, tabular

log = logging.getLogger(__name__)

Line = tuple[dict[str, Any], dict[str, str]]  # entries of the CSV, and LaTeX header -> cell


@dataclass(frozen=True)
class Table:
    """One finished table: numbers for CSV, text for LaTeX."""

    numbers: pd.DataFrame
    latex: str


def build_table(
    comparison: Comparison,
    numbers: list[dict[str, Any]],
    text: Mapping[str, list[str]],
    what: str,
    label: str,
    *,
    unequal: bool = False,
    averaged: bool = True,
    blocks: Sequence[int] = (),
) -> Table:
    """Build a table; its caption names the runs that it is over.

    Args:
        comparison: The runs in it.
        numbers: Lines of the CSV.
        text: LaTeX header -> cells.
        what: First sentences of the caption, without the last full stop.
        label: Name of the table.
        unequal: Whether some mean is over fewer shapes than the others.
        averaged: Whether the seeds of a shape are averaged first.
        blocks: Lines with vertical space after them.
    """
    if not comparison.shapes:
        log.warning(f"{label}: no shape was run with every head ({', '.join(comparison.heads)}); run the missing ones")
    origin = comparison.group.key | {
        "dropped_shapes": " ".join(comparison.dropped),
        "without_mesh": len(comparison.runs[comparison.runs["status"] != "ok"]),
    }
    described = caption(what, comparison, unequal=unequal, averaged=averaged)
    return Table(
        pd.DataFrame([line | origin for line in numbers]),
        tabular(pd.DataFrame(dict(text)), caption=described, label=label, blocks=blocks),
    )


def build_block_table(comparison: Comparison, lines: Sequence[Line], what: str, label: str, block: int) -> Table:
    """Build a table with vertical space after every `block` lines (see `build_table`)."""
    text = {header: [cells[header] for _, cells in lines] for header in lines[0][1]}
    ends = range(block - 1, len(lines), block)
    return build_table(comparison, [numbers for numbers, _ in lines], text, what, label, blocks=ends)


def measured(comparison: Comparison, columns: Sequence[Column]) -> list[Column]:
    """Columns that some run has a value of; all of them where there is none."""
    known = comparison.runs.columns[comparison.runs.notna().any()]
    return [column for column in columns if column.metric in known] or list(columns)


def values_by_head(comparison: Comparison, metric: str) -> dict[str, dict[str, float]]:
    """Head -> shape -> value, seeds averaged."""
    runs = comparison.runs
    if metric not in runs or runs.empty:
        return {head: per_shape(comparison.of(head), metric) for head in comparison.heads}
    values: dict[str, dict[str, float]] = {head: {} for head in comparison.heads}
    means = runs.groupby(["head", "shape"])[metric].mean().reset_index()
    for head, shape, mean in means.itertuples(index=False, name=None):
        values[head][shape] = float(mean)
    return values


def summarise_metrics(runs: pd.DataFrame, metrics: Sequence[str]) -> list[Summary]:
    """Summarise each metric over the shapes of the runs."""
    means = shape_means(runs, metrics)
    return [summarise(means[metric].values()) for metric in metrics]


def has_values(lines: Mapping[str, Sequence[Summary]]) -> bool:
    """True if any summary has a value."""
    return any(summary.n for line in lines.values() for summary in line)


def rank_cells(column: Sequence[Summary], *, digits: int, out_of: int, goal: Goal) -> list[str]:
    """Cells of competing summaries, the best one bold."""
    bold = mark_best(column, digits=digits, out_of=out_of, goal=goal)
    return [cell(item, digits=digits, out_of=out_of, bold=b) for item, b in zip(column, bold, strict=True)]


def rank_columns(lines: Mapping[str, Sequence[Summary]], columns: Sequence[Column], out_of: int) -> list[list[str]]:
    """Cells of each column, for one line per head."""
    return [
        rank_cells([line[i] for line in lines.values()], digits=column.digits, out_of=out_of, goal=column.goal)
        for i, column in enumerate(columns)
    ]


def summary_numbers(metrics: Sequence[str], line: Sequence[Summary]) -> dict[str, float]:
    """The summaries of a line as `<metric>_mean`, `_std` and `_n`."""
    flat: dict[str, float] = {}
    for metric, summary in zip(metrics, line, strict=True):
        flat |= {f"{metric}_mean": summary.mean, f"{metric}_std": summary.std, f"{metric}_n": summary.n}
    return flat


def has_incomplete_means(lines: Mapping[str, Sequence[Summary]], out_of: int) -> bool:
    """True if some mean is over fewer shapes than its line."""
    return any(summary.n < out_of for line in lines.values() for summary in line if summary.n)
