"""Paired tests on the same shapes: heads against the baseline, heads against heads, variants of a study."""

import math
from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

from jointsdf.study.comparisons import Comparison, add_borrowed_baseline, compare
from jointsdf.study.families import Family
from jointsdf.study.groups import BASELINE, Group
from jointsdf.study.statistics import PairedTests, holm, paired_tests, summarise
from jointsdf.study.tables.columns import CONTRASTED, DISTANCE, PAIRED, Column
from jointsdf.study.tables.latex import MISSING, cell, escape, format_number, format_p_value
from jointsdf.study.tables.table import Line, Table, build_block_table, measured, values_by_head

TESTS = (
    "mean difference with its 95% confidence interval (Student's t), two-sided p of the paired t-test and of "
    "Wilcoxon's signed-rank test, each also after Holm's correction over the differences of a metric"
)
Pairs = Sequence[tuple[str, str]]  # a head and its reference


def paired_reconstruction(group: Group, label: str) -> Table | None:
    """Each head minus the baseline on the shapes of all: difference, interval, tests. None without a baseline."""
    comparison = compare(add_borrowed_baseline(group), baseline=True)
    if comparison.heads[:1] != [BASELINE] or len(comparison.heads) < 2:
        return None
    pairs = [(head, BASELINE) for head in comparison.heads[1:]]
    lines = [line for column in measured(comparison, PAIRED) for line in _lines_with_means(comparison, column, pairs)]
    borrowed = f". Runs of {BASELINE}: study {group.borrowed_from}" if group.borrowed_from else ""
    what = (
        f"Each head minus the baseline without one ({BASELINE}) on the same {len(comparison.shapes)} shapes: mean ± "
        f"sample standard deviation, {TESTS}"
    )
    return build_block_table(comparison, lines, what + borrowed, label, len(comparison.heads))


def paired_heads(group: Group, label: str) -> Table | None:
    """Each two heads with labels on the shapes of all: difference, interval, tests. None for fewer than two heads."""
    comparison = compare(group, baseline=False)
    pairs = [(later, earlier) for earlier, later in combinations(comparison.heads, 2)]
    columns = measured(comparison, CONTRASTED)
    lines = [line for column in columns for line in _lines_of_differences(comparison, column, pairs)]
    what = f"Each head minus each other one on the same {len(comparison.shapes)} shapes: {TESTS}"
    return build_block_table(comparison, lines, what, label, len(pairs)) if pairs else None


def variants(family: Family, label: str) -> Table:
    """Each variant of a study minus the first one, for each head: difference, interval, tests."""
    comparison = compare(family.group, baseline=False)
    references = ", ".join(dict.fromkeys(reference for _, reference in family.pairs))
    columns = measured(comparison, (*CONTRASTED, *DISTANCE))
    lines = [line for column in columns for line in _lines_with_means(comparison, column, family.pairs)]
    what = (
        f"Each variant minus {references} on the same {len(comparison.shapes)} shapes: mean ± sample standard "
        f"deviation, {TESTS}"
    )
    return build_block_table(comparison, lines, what, label, len(comparison.heads))


def _lines_with_means(comparison: Comparison, column: Column, pairs: Pairs) -> list[Line]:
    """A line per head: its mean, and the difference from its reference where it has one."""
    values = values_by_head(comparison, column.metric)
    tests = dict(zip((first for first, _ in pairs), _tests(values, pairs), strict=True))
    against = dict(pairs)
    out_of = len(comparison.shapes)
    lines: list[Line] = []
    for head in comparison.heads:
        summary = summarise(values[head].values())
        numbers: dict[str, Any] = {"metric": column.metric, "head": head, "n": summary.n}
        numbers |= {"mean": summary.mean, "std": summary.std}
        cells = {"Metric": column.header if head == comparison.heads[0] else "", "Head": escape(head)}
        cells[r"mean $\pm$ std"] = cell(summary, digits=column.digits, out_of=out_of, bold=False)
        numbers |= {"against": against[head]} if head in against else {}
        lines.append((numbers | _numbers(tests.get(head)), cells | _cells(tests.get(head), column, out_of)))
    return lines


def _lines_of_differences(comparison: Comparison, column: Column, pairs: Pairs) -> list[Line]:
    """A line per difference."""
    tests = _tests(values_by_head(comparison, column.metric), pairs)
    lines: list[Line] = []
    for place, ((head, against), test) in enumerate(zip(pairs, tests, strict=True)):
        cells = {"Metric": "" if place else column.header, "Heads": rf"{escape(head)} $-$ {escape(against)}"}
        numbers = {"metric": column.metric, "head": head, "against": against}
        lines.append((numbers | _numbers(test), cells | _cells(test, column, len(comparison.shapes))))
    return lines


Tested = tuple[PairedTests, tuple[float, ...]]  # and its p values: t, t after Holm, Wilcoxon, Wilcoxon after Holm
P_NAMES = ("p_t", "p_t_holm", "p_wilcoxon", "p_wilcoxon_holm")
P_HEADERS = ("$p_t$", "$p_t$ (Holm)", "$p_W$", "$p_W$ (Holm)")


def _tests(values: Mapping[str, Mapping[str, float]], pairs: Pairs) -> list[Tested]:
    tests = [paired_tests(values[first], values[second]) for first, second in pairs]
    t, wilcoxon = [test.p_t for test in tests], [test.p_wilcoxon for test in tests]
    return list(zip(tests, zip(t, holm(t), wilcoxon, holm(wilcoxon), strict=True), strict=True))


def _numbers(tested: Tested | None) -> dict[str, Any]:
    if tested is None:
        return {}
    test, p_values = tested
    numbers = {"pairs": test.n, "delta": test.delta, "ci95_low": test.low, "ci95_high": test.high}
    return numbers | dict(zip(P_NAMES, p_values, strict=True))


def _cells(tested: Tested | None, column: Column, out_of: int) -> dict[str, str]:
    headers = (r"$\Delta$", r"95\% CI of $\Delta$", *P_HEADERS)
    if tested is None or not tested[0].n:
        return dict.fromkeys(headers, MISSING)
    test, p_values = tested
    digits = column.digits + 1
    fewer = f" ($n={test.n}$)" if test.n < out_of else ""
    interval = (
        MISSING if math.isnan(test.low) else f"[{format_number(test.low, digits)}, {format_number(test.high, digits)}]"
    )
    cells = (format_number(test.delta, digits, signed=True) + fewer, interval, *map(format_p_value, p_values))
    return dict(zip(headers, cells, strict=True))
