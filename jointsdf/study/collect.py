"""Result rows -> one table in memory, and `runs.csv`: one line per run and evaluation protocol."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from jointsdf.provenance import UNKNOWN
from jointsdf.results import ResultRow, write_atomically

DEFAULT_PROTOCOL = "unit"
RUN = ["study", "variant", "recipe", "protocol", "head", "shape", "seed"]
IOU = re.compile(r"iou_(\d+)")
MESH_FILE_SHAPE = re.compile(r".*-[0-9a-f]{6}")  # `<stem>-<6 hex digits>`, whatever the stem


def source_of(shape: str) -> str:
    """Where a shape comes from, by its name: `abc`, `builtin` or `file`."""
    if MESH_FILE_SHAPE.fullmatch(shape):
        return "file"
    return {"abc": "abc", "part": "builtin"}.get(shape.partition("_")[0], "file")


def label_kind(provider: str) -> str:
    """Kind of a label provider, without its settings: `geometric:k=7` -> `geometric`, `file:labels.npy` -> `file`."""
    return provider.partition(":")[0]


def collect(rows: Sequence[ResultRow]) -> pd.DataFrame:
    """Lay the rows out as a table, sorted, one line per run and protocol.

    Columns: the run's identity, its metrics (`iou_k` last, in order of k), `seconds_*`, counts, provenance with nested
    entries flattened (`versions_torch`). What a run does not have is NaN. A run without any score keeps one line.
    """
    lines = [(row, protocol) for row in rows for protocol in row.scores or {DEFAULT_PROTOCOL: {}}]
    metrics = _frame(row.scores.get(protocol, {}) for row, protocol in lines)
    names: list[str] = sorted((str(column) for column in metrics.columns), key=_iou_last)
    sections = [
        _frame(_identity(row, protocol) for row, protocol in lines),
        _frame(_ratio(row.scores.get(protocol, {})) for row, protocol in lines),
        metrics[names],
        _frame({f"seconds_{stage}": seconds for stage, seconds in row.seconds.items()} for row, _ in lines),
        _frame(row.counts for row, _ in lines),
        _frame(_flat(row.provenance) for row, _ in lines),
    ]
    table = pd.concat(sections, axis="columns")
    table = table.loc[:, ~table.columns.duplicated()]
    return table.sort_values(RUN, kind="stable", ignore_index=True) if lines else table


def write_runs(table: pd.DataFrame, path: Path) -> None:
    """Write the table as CSV, atomically; NaN is an empty cell.

    Raises:
        OSError: The folder cannot be written or the disk is full.
    """
    write_atomically(path, table.to_csv(index=False, lineterminator="\n"))


def _frame(records: Iterable[Mapping[str, Any]]) -> pd.DataFrame:
    entries = [dict(record) for record in records]
    return pd.DataFrame(entries, index=range(len(entries)))


def _identity(row: ResultRow, protocol: str) -> dict[str, str | int | float]:
    return {
        "study": row.study,
        "variant": row.variant,
        "recipe": row.recipe,
        "protocol": protocol,
        "head": row.head,
        "shape": row.shape,
        "seed": row.seed,
        "source": source_of(row.shape),
        "label_kind": label_kind(str(row.provenance.get("label_provider", UNKNOWN))),
        "status": row.status,
        "num_parts": row.num_parts,
        "steps": row.steps,
        "peak_memory_mb": row.peak_memory_mb,
    }


def _ratio(scores: Mapping[str, float]) -> dict[str, float]:
    floor = scores.get("cd_l1_floor", math.nan)
    return {"cd_l1_over_floor": scores.get("cd_l1", math.nan) / floor if floor > 0 else math.nan}


def _iou_last(column: str) -> int:
    match = IOU.fullmatch(column)
    return int(match[1]) if match else -1


def _flat(entries: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in entries.items():
        flat |= _flat(value, f"{prefix}{name}_") if isinstance(value, Mapping) else {f"{prefix}{name}": value}
    return flat
