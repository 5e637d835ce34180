"""Comparison with the numbers that the paper prints."""

import logging
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from jointsdf.study.comparisons import Comparison, compare
from jointsdf.study.groups import Group
from jointsdf.study.statistics import Summary
from jointsdf.study.tables.columns import AGAINST_PAPER, Column
from jointsdf.study.tables.latex import MISSING, cell, escape
from jointsdf.study.tables.table import Line, Table, build_block_table, summarise_metrics

log = logging.getLogger(__name__)

FLOOR = "_floor"  # ends the name of a metric of the ground truth against itself
PAPER_TABLE = "main_results.csv"
PAPER_ORIGIN = (
    "Paper: table 'Main results' of Fan and Musialski: its own 50 ABC shapes, PartField labels, 10 epochs of Adam at "
    "5e-5, FlatCAD's protocol, no floors given. Shapes and labels are others than ours: a scale, not a comparison"
)


def against_paper(group: Group, label: str, paper: Path) -> Table | None:
    """Means and floors next to the paper's main table. None for a group without ABC shapes.

    Args:
        group: Runs that may be compared.
        label: Name of the table.
        paper: Folder of the paper's numbers.
    """
    comparison = compare(group, baseline=False)
    if group.key["source"] != "abc" or not comparison.shapes:
        return None
    if not (paper / PAPER_TABLE).is_file():
        log.warning(f"{label}: left out, there is no {paper / PAPER_TABLE}; name the folder of the results (--results)")
        return None
    theirs = pd.read_csv(paper / PAPER_TABLE, comment="#").set_index("head")
    heads = list(dict.fromkeys([*comparison.heads, *map(str, theirs.index)]))
    metrics = [f"{column.metric}{ending}" for column in AGAINST_PAPER for ending in ("", FLOOR)]
    ours = {head: dict(zip(metrics, summarise_metrics(comparison.of(head), metrics), strict=True)) for head in heads}
    lines = [line for column in AGAINST_PAPER for line in _paper_lines(comparison, column, theirs, ours)]
    what = (
        f"Ours over the {len(comparison.shapes)} shapes that every head was run on, beside the paper: mean ± sample "
        f"standard deviation; floor: the ground truth against itself. {PAPER_ORIGIN}"
    )
    return build_block_table(comparison, lines, what, label, len(heads))


def _paper_lines(
    comparison: Comparison, column: Column, theirs: pd.DataFrame, found: Mapping[str, Mapping[str, Summary]]
) -> list[Line]:
    """A line per head, of the summaries found by head and metric."""
    lines: list[Line] = []
    for head, summaries in found.items():
        ours, floor = summaries[column.metric], summaries[column.metric + FLOOR]
        mean, std = _printed(theirs, head, column.metric)
        numbers: dict[str, Any] = {"metric": column.metric, "head": head, "n": ours.n}
        numbers |= {"mean": ours.mean, "std": ours.std, "floor_mean": floor.mean, "floor_std": floor.std}
        cells = {"Metric": "" if lines else column.header, "Head": escape(head)}
        for name, summary in (("ours", ours), ("our floor", floor)):
            cells[name] = cell(summary, digits=column.digits, out_of=len(comparison.shapes), bold=False)
        cells["paper"] = MISSING if math.isnan(mean) else rf"{mean:.2f} $\pm$ {std:.2f}"
        lines.append((numbers | {"paper_mean": mean, "paper_std": std}, cells))
    return lines


def _printed(theirs: pd.DataFrame, head: str, metric: str) -> tuple[float, float]:
    if head not in theirs.index or f"{metric}_mean" not in theirs:
        return math.nan, math.nan
    mean, std = theirs.loc[head, [f"{metric}_mean", f"{metric}_std"]].to_numpy(dtype=float)
    return float(mean), float(std)
