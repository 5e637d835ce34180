"""Rows of a study as its page reads them: a record per run, with the measures that some run has. Imports no torch."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from jointsdf.runs.records import DEFAULT_PROTOCOL, HOLDOUT, flatten_rows
from jointsdf.runs.row import ResultRow
from jointsdf.study.comparisons import HEAD_ORDER


class Measure(NamedTuple):
    """A column of flat rows, in words, and its better end: `low` or `high`."""

    column: str
    words: str
    goal: str


MEASURES = (
    Measure("cd_l1_over_floor", "Chamfer distance / floor", "low"),
    Measure("miou_exact_over_ceiling", "label overlap / ceiling", "high"),
    Measure("surface_p99", "surface distance, 99%", "low"),
    Measure("surface_max", "surface distance, largest", "low"),
    Measure("nc", "normal consistency", "high"),
    Measure("f1", "F1", "high"),
    Measure("edge_f1_fine_over_ceiling", "crease F1 / ceiling", "high"),
    Measure("miou_exact", "label overlap, exact", "high"),
    Measure("acc_exact", "right labels, exact", "high"),
    Measure("boundary_f1", "part borders, F1", "high"),
    Measure("sdf_relative_mean", "distance, relative error", "low"),
    Measure("held_out_p99", "held-out points, 99%", "low"),
    Measure("held_out_acc", "held-out labels", "high"),
    Measure("seconds_fit", "seconds of the fit", "low"),
    Measure("seconds_total", "seconds in all", "low"),
)


class Records(NamedTuple):
    """The runs of a study.

    Attributes:
        runs: `column` (head, with its variant where there are several), `shape`, `seed`, `status` and `values`, one per
            measure, None where there is no number.
        measures: Those that some run has.
        columns: Of the runs, in the order of the tables.
        shapes: Of the runs, by name.
    """

    runs: list[dict[str, Any]]
    measures: list[Measure]
    columns: list[str]
    shapes: list[str]


def records(rows: Sequence[ResultRow]) -> Records:
    """The rows of one study, by the default protocol, or by held-out points where there is no other.

    Args:
        rows: At least one.
    """
    flat = flatten_rows(rows)
    lines = [dict(zip(flat, values, strict=True)) for values in zip(*flat.values(), strict=True)]
    lines = [line for line in lines if line["protocol"] in (DEFAULT_PROTOCOL, HOLDOUT)]
    measures = [measure for measure in MEASURES if any(_number(line.get(measure.column)) is not None for line in lines)]
    variants = len({line["variant"] for line in lines}) > 1
    runs = [
        {
            "column": column_name(str(line["head"]), str(line["variant"]), variants=variants),
            **{name: line[name] for name in ("shape", "seed", "status")},
            "values": [_number(line.get(measure.column)) for measure in measures],
        }
        for line in lines
    ]
    columns = sorted({run["column"] for run in runs}, key=_head_first)
    return Records(runs, measures, columns, sorted({run["shape"] for run in runs}))


def column_name(head: str, variant: str, *, variants: bool) -> str:
    """Name of a run's column: its head, and its variant where the study has several."""
    return f"{head}, {variant}" if variants else head


def _number(value: Any) -> float | None:
    """The value, None where it is no finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return float(value)


def _head_first(column: str) -> tuple[int, str]:
    head = column.partition(",")[0]
    return (HEAD_ORDER.index(head) if head in HEAD_ORDER else len(HEAD_ORDER), column)
