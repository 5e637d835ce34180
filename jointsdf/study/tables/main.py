"""Tables with a line per head: reconstruction, segmentation, IoU of each part, part counts, seeds, cost."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import pandas as pd

from jointsdf.runs.records import IOU
from jointsdf.study.captions import SEVERAL, describe_machines
from jointsdf.study.comparisons import Comparison, compare
from jointsdf.study.groups import Group
from jointsdf.study.statistics import Summary, pooled_deviation
from jointsdf.study.tables.columns import (
    BY_PART_COUNT,
    CONTRASTED,
    COST,
    DISTANCE,
    EDGES,
    HELD_OUT,
    RECONSTRUCTION,
    SEGMENTATION,
    Column,
)
from jointsdf.study.tables.latex import MISSING, cell, escape
from jointsdf.study.tables.table import (
    Table,
    build_table,
    has_incomplete_means,
    has_values,
    rank_cells,
    rank_columns,
    summarise_metrics,
    summary_numbers,
)

REFERENCES = {"floor": "the ground truth against itself", "ceiling": "what grid and face rule alone cost"}
DENSE_BELOW = 100  # with all part ids below, every id up to the last is listed, "--" where no shape has it
PART_COUNTS = ((2, 4), (5, 8), (9, 18), (19, None))
MEAN = "mean ± sample standard deviation over the shapes that every head was run on (N)"


def main_reconstruction(group: Group, label: str) -> Table | None:
    """Reconstruction metrics, a line per head, the baseline included."""
    what = f"Reconstruction (Chamfer distances times 100), {MEAN}"
    return _by_head(what, compare(group, baseline=True), RECONSTRUCTION, {}, label)


def main_segmentation(group: Group, label: str) -> Table | None:
    """Segmentation metrics, a line per head, then floor or ceiling. None for a group without labels."""
    references = ", ".join(f"{name}: {meaning}" for name, meaning in REFERENCES.items()) + " (c)"
    what = f"Segmentation ({references}), {MEAN}"
    return _by_head(what, compare(group, baseline=False), SEGMENTATION, REFERENCES, label)


def distance(group: Group, label: str) -> Table | None:
    """Errors of the field away from the surface, a line per head. None for a group of rows without them."""
    what = f"Distance away from the surface (uniform in the box; bands of 5 and 1 percent of the longest side), {MEAN}"
    comparison = compare(group, baseline=True)
    measured = {column.metric for column in DISTANCE} & set(comparison.runs.columns)
    return _by_head(what, comparison, DISTANCE, {}, label) if measured else None


def edges(group: Group, label: str) -> Table | None:
    """Creases and planes, a line per head, then the ceiling. None for a group of rows without them."""
    what = (
        "Edges: creases (fine: within 0.2 percent of the longest side, else 0.5), normals within 1 percent of them, "
        f"planes and part borders on creases (ceiling: {REFERENCES['ceiling']}), {MEAN}"
    )
    comparison = compare(group, baseline=True)
    measured = {column.metric for column in EDGES} & set(comparison.runs.columns)
    references = {"ceiling": REFERENCES["ceiling"]}
    return _by_head(what, comparison, EDGES, references, label) if measured else None


def held_out(group: Group, label: str) -> Table | None:
    """Point clouds without a truth: distances and labels at points held out of the fit, a line per head."""
    what = (
        "Held-out points of clouds without a truth: distance to the surface, and of the surface to the "
        f"cloud, in shares of the longest side; area that the cloud does not cover; labels at held-out points, {MEAN}"
    )
    return _by_head(what, compare(group, baseline=True), HELD_OUT, {}, label)


def cost(group: Group, label: str) -> Table | None:
    """Seconds of each stage, peak memory and size, a line per head."""
    comparison = compare(group, baseline=True)
    origin = describe_machines(comparison.runs)
    what = f"Cost in seconds and MiB, {MEAN}. {origin}"
    columns = [replace(column, goal="none") for column in COST] if origin.startswith(SEVERAL) else COST
    return _by_head(what, comparison, columns, {}, label)


def per_part_iou(group: Group, label: str) -> Table | None:
    """IoU of each part, a line per part, a column per head. None for a group without labels."""
    comparison = compare(group, baseline=False)
    parts = _part_ids(comparison.runs)
    metrics = [f"iou_{part}" for part in parts]
    heads = {head: summarise_metrics(comparison.of(head), metrics) for head in comparison.heads}
    if not heads or not parts:
        return None
    rows = list(zip(*heads.values(), strict=True))
    counts = [max(summary.n for summary in row) for row in rows]
    text = {"Part": [f"$P_{{{part}}}$" for part in parts], "$N$": [str(n) for n in counts]}
    cells = [rank_cells(row, digits=2, out_of=n, goal="high") for row, n in zip(rows, counts, strict=True)]
    text |= {escape(head): [row[column] for row in cells] for column, head in enumerate(heads)}
    numbers = [
        {"head": head, "part": part, "n": summary.n, "iou_mean": summary.mean, "iou_std": summary.std}
        for head, line in heads.items()
        for part, summary in zip(parts, line, strict=True)
    ]
    fewer = any(summary.n < n for row, n in zip(rows, counts, strict=True) for summary in row)
    what = "IoU of each part, mean ± sample standard deviation over those of the common shapes that have it (N)"
    return build_table(comparison, numbers, text, what, label, unequal=fewer)


def part_count(group: Group, label: str) -> Table | None:
    """The main metrics by the number of parts, a block of lines per range. None for a group without labels."""
    comparison = compare(group, baseline=False)
    counts = comparison.runs.groupby("shape")["num_parts"].max()
    metrics = [column.metric for column in BY_PART_COUNT]
    text: dict[str, list[str]] = {name: [] for name in ("Parts", "Head", "$N$")}
    text |= {column.header: [] for column in BY_PART_COUNT}
    numbers: list[dict[str, Any]] = []
    fewer, blocks = False, []
    for low, high in PART_COUNTS:
        shapes = counts[(counts >= low) & (counts <= (high or counts.max()))].index
        if shapes.empty:
            continue
        name = f"{low}-{high}" if high else f">{low - 1}"
        runs = comparison.runs[comparison.runs["shape"].isin(shapes)]
        heads = {head: summarise_metrics(runs[runs["head"] == head], metrics) for head in comparison.heads}
        text["Parts"] += [escape(name).replace("-", "--"), *[""] * (len(heads) - 1)]
        text["Head"] += map(escape, heads)
        text["$N$"] += [str(len(shapes))] * len(heads)
        for column, cells in zip(BY_PART_COUNT, rank_columns(heads, BY_PART_COUNT, len(shapes)), strict=True):
            text[column.header] += cells
        numbers += [
            {"parts": name, "head": head, "n": len(shapes)} | summary_numbers(metrics, line)
            for head, line in heads.items()
        ]
        fewer |= has_incomplete_means(heads, len(shapes))
        blocks.append(len(numbers) - 1)
    what = f"By the number of parts of the ground truth, {MEAN}"
    return build_table(comparison, numbers, text, what, label, unequal=fewer, blocks=blocks) if numbers else None


def seeds(group: Group, label: str) -> Table | None:
    """Standard deviation over the seeds of one head and shape. None where no shape has two seeds."""
    counts = group.runs.groupby(["head", "shape"])["seed"].transform("nunique")
    runs = group.runs[counts > 1]
    common = compare(replace(group, runs=runs), baseline=True)
    repeated = replace(common, runs=runs, shapes=sorted(runs["shape"].unique()), dropped={})  # heads are not compared
    text: dict[str, list[str]] = {name: [] for name in ("Head", *(column.header for column in CONTRASTED))}
    numbers: list[dict[str, Any]] = []
    for head in repeated.heads:
        text["Head"].append(escape(head))
        numbers.append({"head": head})
        for column in CONTRASTED:
            n, deviation = pooled_deviation(repeated.of(head), column.metric)
            numbers[-1] |= {f"{column.metric}_std": deviation, f"{column.metric}_n": n}
            text[column.header].append(f"{deviation:.{column.digits + 1}f} ({n})" if n else MISSING)
    what = (
        "What chance alone changes: standard deviation over the seeds of one shape, pooled over the shapes that were "
        "run with several (in brackets, how many)"
    )
    return build_table(repeated, numbers, text, what, label, averaged=False) if numbers else None


def _by_head(
    what: str, comparison: Comparison, columns: Sequence[Column], references: Mapping[str, str], label: str
) -> Table | None:
    n = len(comparison.shapes)
    metrics = [column.metric for column in columns]
    heads = {head: summarise_metrics(comparison.of(head), metrics) for head in comparison.heads}
    if not heads or (n and not has_values(heads)):
        return None
    below = {
        kind: summarise_metrics(comparison.runs, [f"{metric}_{kind}" for metric in metrics]) for kind in references
    }
    below = {kind: line for kind, line in below.items() if has_values({kind: line})}
    last = [rf"\textit{{{' or '.join(below)}}}"] if below else []
    text = {"Head": [*map(escape, heads), *last], "$N$": [str(n)] * (len(heads) + len(last))}
    for i, (column, cells) in enumerate(zip(columns, rank_columns(heads, columns, n), strict=True)):
        if any(line[i].n for line in heads.values()):
            text[column.header] = cells + [_reference(below, i, column.digits, n)] * len(last)
    numbers = [{"head": name, "n": n} | summary_numbers(metrics, line) for name, line in (heads | below).items()]
    blocks = [len(heads) - 1] if below else []
    return build_table(comparison, numbers, text, what, label, unequal=has_incomplete_means(heads, n), blocks=blocks)


def _reference(below: Mapping[str, Sequence[Summary]], i: int, digits: int, n: int) -> str:
    """Cell of the first reference that a metric has; of a later one with its initial."""
    for number, (kind, line) in enumerate(below.items()):
        if line[i].n:
            return cell(line[i], digits=digits, out_of=n, bold=False) + (f" ({kind[0]})" if number else "")
    return MISSING


def _part_ids(runs: pd.DataFrame) -> list[int]:
    """Parts of the shapes, ascending; all ids up to the last where they are below `DENSE_BELOW`."""
    with_numbers = [str(column) for column in runs.columns if IOU.fullmatch(str(column)) and runs[column].notna().any()]
    ids = sorted(int(column.removeprefix("iou_")) for column in with_numbers)
    return list(range(ids[-1] + 1)) if ids and ids[-1] < DENSE_BELOW else ids
