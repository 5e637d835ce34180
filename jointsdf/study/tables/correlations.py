"""Reconstruction against segmentation: correlations, and the best against the worst quarter of the shapes."""

import math
from collections.abc import Sequence
from typing import Any

from jointsdf.study.comparisons import Comparison, compare
from jointsdf.study.groups import Group
from jointsdf.study.statistics import Correlation, outer_quarters, pearson, per_shape, summarise
from jointsdf.study.tables.columns import EXACT, PAPER, Column, Relation
from jointsdf.study.tables.latex import MISSING, cell, escape, format_number, format_p_value
from jointsdf.study.tables.table import Table, build_table, values_by_head

OVERALL, BEST = "overall", "best"


def correlation(group: Group, label: str) -> Table | None:
    """Pearson correlations of the paper's columns, a line per pair of metrics. None where there are none."""
    return _correlation(compare(group, baseline=False), PAPER, label)


def correlation_exact(group: Group, label: str) -> Table | None:
    """Pearson correlations of errors over their floors with the exact label scores; else as `correlation`."""
    return _correlation(compare(group, baseline=False), EXACT, label)


def quartiles(group: Group, label: str) -> Table | None:
    """Segmentation in the quarters of the shapes with least and most cd_l1, per head. None below four shapes."""
    return _quartiles(compare(group, baseline=False), PAPER, PAPER.reconstruction[:1], label)


def quartiles_exact(group: Group, label: str) -> Table | None:
    """Exact label scores in the outer quarters by error over floor; else as `quartiles`."""
    return _quartiles(compare(group, baseline=False), EXACT, EXACT.reconstruction, label)


def _correlation(comparison: Comparison, relation: Relation, label: str) -> Table | None:
    text: dict[str, list[str]] = {"": []}
    numbers: list[dict[str, Any]] = []
    text |= {name: [] for name in (OVERALL, *map(escape, comparison.heads))}
    for x in relation.reconstruction:
        for y in relation.segmentation:
            found = _correlations(values_by_head(comparison, x.metric), values_by_head(comparison, y.metric))
            text[""].append(rf"{x.name} $\leftrightarrow$ {y.name}")
            for head, item in found.items():
                pairs = len(comparison.shapes) * (len(comparison.heads) if head == OVERALL else 1)
                text[escape(head)].append(_correlation_cell(item, pairs))
                numbers.append(
                    {"reconstruction": x.metric, "segmentation": y.metric, "head": head}
                    | {"n": item.n, "r": item.r, "p": item.p}
                )
    if all(math.isnan(line["r"]) for line in numbers):
        return None
    what = (
        f"Pearson correlation r (two-sided p) over the {len(comparison.shapes)} shapes that every head was run on. "
        f"{OVERALL.capitalize()}: all heads' shapes together, which are not independent: its p is too small"
    )
    blocks = range(len(relation.segmentation) - 1, len(text[""]), len(relation.segmentation))
    return build_table(comparison, numbers, text, what, label, blocks=blocks)


def _correlations(x: dict[str, dict[str, float]], y: dict[str, dict[str, float]]) -> dict[str, Correlation]:
    pairs = {head: [(value, y[head][shape]) for shape, value in line.items()] for head, line in x.items()}
    everything = [pair for line in pairs.values() for pair in line]
    return {OVERALL: pearson(everything)} | {head: pearson(line) for head, line in pairs.items()}


def _correlation_cell(item: Correlation, pairs: int) -> str:
    fewer = f", $n={item.n}$" if item.n < pairs else ""
    return MISSING if math.isnan(item.r) else f"{format_number(item.r, 2)} ({format_p_value(item.p)}{fewer})"


def _quartiles(comparison: Comparison, relation: Relation, keys: Sequence[Column], label: str) -> Table | None:
    measures = {column: values_by_head(comparison, column.metric) for column in relation.segmentation}
    quarters = [
        (key, head, name, shapes, ranks)
        for key, ranked in zip(keys, (_ranks(comparison, key.metric) for key in keys), strict=True)
        for head, ranks in ranked.items()
        for name, shapes in _quarters(ranks, key).items()
    ]
    text: dict[str, list[str]] = {name: [] for name in ("By", "Head", "Quarter", "$N$", "Range")}
    text |= {column.header: [] for column in measures}
    numbers: list[dict[str, Any]] = []
    for key, head, name, shapes, ranks in quarters:
        low, high = (pick(ranks[shape] for shape in shapes) for pick in (min, max))
        line = {"by": key.metric, "head": head, "quarter": name, "n": len(shapes), "low": low, "high": high}
        new = not numbers or numbers[-1]["by"] != key.metric
        cells = [key.name if new else "", escape(head) if name == BEST else "", name, str(len(shapes))]
        cells.append(f"{format_number(low, key.digits)} to {format_number(high, key.digits)}")
        for column, found in measures.items():
            summary = summarise(found[head][shape] for shape in shapes)
            line |= {f"{column.metric}_mean": summary.mean, f"{column.metric}_std": summary.std}
            cells.append(cell(summary, digits=column.digits, out_of=len(shapes), bold=False))
        for header, content in zip(text, cells, strict=True):
            text[header].append(content)
        numbers.append(line | {"shapes": " ".join(sorted(shapes))})
    what = (
        "Segmentation (mean ± sample standard deviation) in the best and the worst quarter of the "
        f"{len(comparison.shapes)} shapes that every head was run on, per head, by reconstruction; N is rounded down, "
        "and a run without a mesh is in neither"
    )
    last = [place for place, line in enumerate(numbers[:-1]) if line["by"] != numbers[place + 1]["by"]]
    return build_table(comparison, numbers, text, what, label, blocks=last) if numbers else None


def _ranks(comparison: Comparison, metric: str) -> dict[str, dict[str, float]]:
    """`values_by_head` of the runs with a mesh."""
    runs = {head: comparison.of(head) for head in comparison.heads}
    return {head: per_shape(part[part["status"] == "ok"], metric) for head, part in runs.items()}


def _quarters(ranks: dict[str, float], key: Column) -> dict[str, list[str]]:
    low, high = outer_quarters(ranks)
    if not low:
        return {}
    return {BEST: low, "worst": high} if key.goal == "low" else {BEST: high, "worst": low}
