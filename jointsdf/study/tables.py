"""The paper's tables from the rows on disk, as CSV and LaTeX: reconstruction, segmentation, IoU of each part.

Heads are compared on the shapes that all of them have, seeds are averaged first; the caption lists what is left out.
"""

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from jointsdf.results import read_rows, write_atomically
from jointsdf.study.captions import caption
from jointsdf.study.collect import IOU, collect, write_runs
from jointsdf.study.columns import RECONSTRUCTION, SEGMENTATION, Column
from jointsdf.study.groups import SUFFIX, Comparison, Group, compare, split
from jointsdf.study.latex import Goal, best, cell, escape, tabular
from jointsdf.study.statistics import Summary, per_shape, summarise

log = logging.getLogger(__name__)

REFERENCES = {"floor": "the ground truth against itself", "ceiling": "what grid and face rule alone cost"}
GAPS_SHOWN_BELOW = 100  # part ids up to here are listed without gaps, "--" where no shape has the part
ENDINGS = (".csv", ".tex")


@dataclass(frozen=True)
class Table:
    """One finished table: numbers for CSV, text for LaTeX."""

    numbers: pd.DataFrame
    latex: str


def write_tables(outputs: Path) -> list[Path]:
    """Write `runs.csv` and the tables of all rows below a folder to its `tables/`; delete tables of groups gone since.

    Returns:
        The files written, `runs.csv` first.

    Raises:
        ValueError: There is no readable row. One line, with the fix.
        OSError: The folder cannot be written.
    """
    rows, problems = read_rows(outputs)
    for problem in problems:
        log.warning(problem)
    if not rows:
        raise ValueError(f"{outputs}: no result rows below it; make one with `python train.py`, or name another folder")
    runs, folder = collect(rows), outputs / "tables"
    written = [folder / "runs.csv"]
    write_runs(runs, written[0])
    for group in split(runs):
        for name, build in BUILDERS.items():
            if table := build(group, name + group.suffix):
                written += _write(table, folder / (name + group.suffix))
    for name in BUILDERS:
        old = {folder / (name + ending) for ending in ENDINGS} | set(folder.glob(f"{name}{SUFFIX}*"))
        for path in old - set(written):
            path.unlink(missing_ok=True)
    return written


def _write(table: Table, stem: Path) -> list[Path]:
    csv, tex = (stem.with_name(stem.name + ending) for ending in ENDINGS)
    write_atomically(csv, table.numbers.to_csv(index=False, lineterminator="\n"))
    write_atomically(tex, table.latex)
    return [csv, tex]


def main_reconstruction(group: Group, label: str) -> Table | None:
    """Reconstruction metrics, a line per head, the baseline included."""
    what = "Reconstruction (Chamfer distances times 100)"
    return _main_table(what, compare(group, baseline=True), RECONSTRUCTION, {}, label)


def main_segmentation(group: Group, label: str) -> Table | None:
    """Segmentation metrics, a line per head, then floor and ceiling. None for a group without labels."""
    what = f"Segmentation ({', '.join(f'{name}: {meaning}' for name, meaning in REFERENCES.items())})"
    return _main_table(what, compare(group, baseline=False), SEGMENTATION, REFERENCES, label)


def per_part_iou(group: Group, label: str) -> Table | None:
    """IoU of each part, a line per part, a column per head. None for a group without labels."""
    comparison = compare(group, baseline=False)
    parts = _part_ids(comparison.runs)
    metrics = [f"iou_{part}" for part in parts]
    heads = {head: _summaries(comparison.of(head), metrics) for head in comparison.heads}
    if not heads or not parts:
        return None
    rows = list(zip(*heads.values(), strict=True))
    counts = [max(summary.n for summary in row) for row in rows]
    text = {"Part": [f"$P_{{{part}}}$" for part in parts], "$N$": [str(n) for n in counts]}
    cells = [_ranked_cells(row, digits=2, out_of=n, goal="high") for row, n in zip(rows, counts, strict=True)]
    text |= {escape(head): [row[column] for row in cells] for column, head in enumerate(heads)}
    numbers = [
        {"head": head, "part": part, "n": summary.n, "iou_mean": summary.mean, "iou_std": summary.std}
        for head, line in heads.items()
        for part, summary in zip(parts, line, strict=True)
    ]
    unequal = any(summary.n < n for row, n in zip(rows, counts, strict=True) for summary in row)
    return _finished(comparison, numbers, text, "IoU of each part, where a shape has it", label, unequal=unequal)


BUILDERS: dict[str, Callable[[Group, str], Table | None]] = {
    "main_reconstruction": main_reconstruction,
    "main_segmentation": main_segmentation,
    "per_part_iou": per_part_iou,
}


def _main_table(
    what: str, comparison: Comparison, columns: tuple[Column, ...], references: Mapping[str, str], label: str
) -> Table | None:
    n = len(comparison.shapes)
    metrics = [column.metric for column in columns]
    heads = {head: _summaries(comparison.of(head), metrics) for head in comparison.heads}
    if not heads or (n and not _measured(heads)):
        return None
    below = {kind: _summaries(comparison.runs, [f"{metric}_{kind}" for metric in metrics]) for kind in references}
    below = {kind: line for kind, line in below.items() if _measured({kind: line})}
    text = {
        "Head": [*map(escape, heads), *(rf"\textit{{{kind}}}" for kind in below)],
        "$N$": [str(n)] * (len(heads) + len(below)),
    }
    for i, column in enumerate(columns):
        ranked = [line[i] for line in heads.values()]
        text[column.header] = _ranked_cells(ranked, digits=column.digits, out_of=n, goal=column.goal)
        text[column.header] += [cell(line[i], digits=column.digits, out_of=n, bold=False) for line in below.values()]
    numbers = [{"head": name, "n": n} | _spread(metrics, line) for name, line in (heads | below).items()]
    unequal = any(summary.n < n for line in heads.values() for summary in line if summary.n)
    return _finished(comparison, numbers, text, what, label, unequal=unequal)


def _finished(
    comparison: Comparison,
    numbers: list[dict[str, Any]],
    text: dict[str, list[str]],
    what: str,
    label: str,
    *,
    unequal: bool,
) -> Table:
    if not comparison.shapes:
        log.warning(f"{label}: no shape was run with every head ({', '.join(comparison.heads)}); run the missing ones")
    origin = comparison.group.key | {
        "dropped_shapes": " ".join(comparison.dropped),
        "without_mesh": len(comparison.runs[comparison.runs["status"] != "ok"]),
    }
    latex = tabular(pd.DataFrame(text), caption=caption(what, comparison, unequal=unequal), label=label)
    return Table(pd.DataFrame([line | origin for line in numbers]), latex)


def _ranked_cells(summaries: Sequence[Summary], *, digits: int, out_of: int, goal: Goal) -> list[str]:
    bold = best(summaries, digits=digits, out_of=out_of, goal=goal)
    return [cell(item, digits=digits, out_of=out_of, bold=b) for item, b in zip(summaries, bold, strict=True)]


def _summaries(runs: pd.DataFrame, metrics: list[str]) -> list[Summary]:
    return [summarise(per_shape(runs, metric).values()) for metric in metrics]


def _measured(lines: Mapping[str, list[Summary]]) -> bool:
    return any(summary.n for line in lines.values() for summary in line)


def _spread(metrics: list[str], summaries: list[Summary]) -> dict[str, float]:
    flat: dict[str, float] = {}
    for metric, summary in zip(metrics, summaries, strict=True):
        flat |= {f"{metric}_mean": summary.mean, f"{metric}_std": summary.std, f"{metric}_n": summary.n}
    return flat


def _part_ids(runs: pd.DataFrame) -> list[int]:
    """Parts of the shapes, ascending; without gaps where the ids are small."""
    measured = [str(column) for column in runs.columns if IOU.fullmatch(str(column)) and runs[column].notna().any()]
    ids = sorted(int(column.removeprefix("iou_")) for column in measured)
    return list(range(ids[-1] + 1)) if ids and ids[-1] < GAPS_SHOWN_BELOW else ids
