"""Heads against the baseline without one, on the same shapes; our numbers beside the paper's."""

import logging
import math
from pathlib import Path
from typing import Any

import pandas as pd

from jointsdf.study.columns import AGAINST_PAPER, PAIRED, Column
from jointsdf.study.groups import BASELINE, Comparison, Group, compare, with_borrowed_baseline
from jointsdf.study.latex import MISSING, cell, escape, number, p_value
from jointsdf.study.statistics import Paired, Summary, holm, paired, per_shape, summarise
from jointsdf.study.table import Table, finished

log = logging.getLogger(__name__)

Line = tuple[dict[str, Any], dict[str, str]]  # what goes into the CSV, and LaTeX header -> cell
PAPER_TABLE = "main_results.csv"
PAPER_ORIGIN = (
    "Paper: table 'Main results' of Fan and Musialski: its own 50 ABC shapes, PartField labels, 10 epochs of Adam at "
    "5e-5, FlatCAD's protocol, no floors given. Shapes and labels are others than ours: a scale, not a comparison"
)


def paired_reconstruction(group: Group, label: str) -> Table | None:
    """Each head minus the baseline on the shapes of all: difference, interval, tests. None without a baseline."""
    comparison = compare(with_borrowed_baseline(group), baseline=True)
    if comparison.heads[:1] != [BASELINE] or len(comparison.heads) < 2:
        return None
    lines = [line for column in PAIRED for line in _paired_lines(comparison, column)]
    borrowed = f". Runs of {BASELINE}: study {group.borrowed_from}" if group.borrowed_from else ""
    what = (
        f"Each head minus the baseline without one ({BASELINE}) on the same {len(comparison.shapes)} shapes: mean ± "
        "sample standard deviation, mean difference with its 95% confidence interval (Student's t), two-sided p of the "
        "paired t-test and of Wilcoxon's signed-rank test, each also after Holm's correction over the heads of a metric"
    )
    return _table(comparison, lines, what + borrowed, label, len(comparison.heads))


def against_paper(group: Group, label: str, paper: Path) -> Table | None:
    """Our means and floors beside the paper's main table. None for a group without ABC shapes.

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
    lines = [line for column in AGAINST_PAPER for line in _paper_lines(comparison, column, theirs, heads)]
    what = (
        f"Ours over the {len(comparison.shapes)} shapes that every head was run on, beside the paper: mean ± sample "
        f"standard deviation; floor: the ground truth against itself. {PAPER_ORIGIN}"
    )
    return _table(comparison, lines, what, label, len(heads))


def _table(comparison: Comparison, lines: list[Line], what: str, label: str, block: int) -> Table:
    text = {header: [cells[header] for _, cells in lines] for header in lines[0][1]}
    blocks = range(block - 1, len(lines), block)
    return finished(comparison, [numbers for numbers, _ in lines], text, what, label, blocks=blocks)


def _paired_lines(comparison: Comparison, column: Column) -> list[Line]:
    heads, out_of = comparison.heads[1:], len(comparison.shapes)
    values = {head: per_shape(comparison.of(head), column.metric) for head in comparison.heads}
    tests = {head: paired(values[head], values[BASELINE]) for head in heads}
    t_holm = dict(zip(heads, holm([test.p_t for test in tests.values()]), strict=True))
    wilcoxon_holm = dict(zip(heads, holm([test.p_wilcoxon for test in tests.values()]), strict=True))
    lines: list[Line] = []
    for head in comparison.heads:
        summary = summarise(values[head].values())
        numbers: dict[str, Any] = {"metric": column.metric, "head": head, "n": summary.n}
        numbers |= {"mean": summary.mean, "std": summary.std}
        cells = {"Metric": column.header if head == BASELINE else "", "Head": escape(head)}
        cells[r"mean $\pm$ std"] = cell(summary, digits=column.digits, out_of=out_of, bold=False)
        if head == BASELINE:
            cells |= dict.fromkeys(_test_cells(column, tests[heads[0]], (), out_of), MISSING)
        else:
            test = tests[head]
            p_values = (test.p_t, t_holm[head], test.p_wilcoxon, wilcoxon_holm[head])
            numbers |= {"pairs": test.n, "delta": test.delta, "ci95_low": test.low, "ci95_high": test.high}
            numbers |= dict(zip(("p_t", "p_t_holm", "p_wilcoxon", "p_wilcoxon_holm"), p_values, strict=True))
            cells |= _test_cells(column, test, p_values, out_of)
        lines.append((numbers, cells))
    return lines


def _test_cells(column: Column, test: Paired, p_values: tuple[float, ...], out_of: int) -> dict[str, str]:
    digits = column.digits + 1
    delta = number(test.delta, digits, signed=True) if test.n else MISSING
    fewer = f" ($n={test.n}$)" if test.n < out_of else ""
    interval = f"[{number(test.low, digits)}, {number(test.high, digits)}]"
    cells = {r"$\Delta$": delta + fewer, r"95\% CI of $\Delta$": MISSING if math.isnan(test.low) else interval}
    names = ("$p_t$", "$p_t$ (Holm)", "$p_W$", "$p_W$ (Holm)")
    return cells | dict(zip(names, map(p_value, p_values or [math.nan] * 4), strict=True))


def _paper_lines(comparison: Comparison, column: Column, theirs: pd.DataFrame, heads: list[str]) -> list[Line]:
    lines: list[Line] = []
    for head in heads:
        ours, floor = (_summary(comparison, head, f"{column.metric}{ending}") for ending in ("", "_floor"))
        mean, std = _printed(theirs, head, column.metric)
        numbers: dict[str, Any] = {"metric": column.metric, "head": head, "n": ours.n}
        numbers |= {"mean": ours.mean, "std": ours.std, "floor_mean": floor.mean, "floor_std": floor.std}
        cells = {"Metric": column.header if head == heads[0] else "", "Head": escape(head)}
        for name, summary in (("ours", ours), ("our floor", floor)):
            cells[name] = cell(summary, digits=column.digits, out_of=len(comparison.shapes), bold=False)
        cells["paper"] = MISSING if math.isnan(mean) else rf"{mean:.2f} $\pm$ {std:.2f}"
        lines.append((numbers | {"paper_mean": mean, "paper_std": std}, cells))
    return lines


def _summary(comparison: Comparison, head: str, metric: str) -> Summary:
    return summarise(per_shape(comparison.of(head), metric).values())


def _printed(theirs: pd.DataFrame, head: str, metric: str) -> tuple[float, float]:
    if head not in theirs.index or f"{metric}_mean" not in theirs:
        return math.nan, math.nan
    mean, std = theirs.loc[head, [f"{metric}_mean", f"{metric}_std"]].to_numpy(dtype=float)
    return float(mean), float(std)
