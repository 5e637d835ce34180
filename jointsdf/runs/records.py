"""Result rows as flat records, one per run and evaluation protocol: the columns of the CSV and of every table.

Columns, left to right: the run, what is derived from its metrics, the metrics (`iou_k` last), `peak_memory_mb`,
`seconds_*`, counts, `schema`, provenance (`versions.torch` for an entry of an entry). A count or fact whose name is
taken by a section left of it, in this row or another, has that of its own section before it.
"""

import math
import re
from collections.abc import Container, Iterable, Mapping
from typing import Any

from jointsdf.runs.columns import COUNTS, DERIVED, FACTS, MEMORY, PROVENANCE, RUN, SCHEMA_COLUMN, SECONDS
from jointsdf.runs.provenance import UNKNOWN
from jointsdf.runs.row import ResultRow

DEFAULT_PROTOCOL = "unit"
HOLDOUT = "holdout"  # protocol of point clouds without a truth: held-out points
IOU = re.compile(r"iou_(\d+)")
MESH_FILE_SHAPE = re.compile(r".*-[0-9a-f]{6}")  # `<stem>-<6 hex digits>`, whatever the stem


def source_of(shape: str) -> str:
    """Source of a shape by its name: `abc`, `builtin` or `file`.

    >>> [source_of(name) for name in ("abc_0001", "part_01", "bracket-0a1b2c")]
    ['abc', 'builtin', 'file']
    """
    if MESH_FILE_SHAPE.fullmatch(shape):
        return "file"
    return {"abc": "abc", "part": "builtin"}.get(shape.partition("_")[0], "file")


def label_kind(provider: str) -> str:
    """Kind of a label provider, without its settings.

    >>> label_kind("geometric:k=7")
    'geometric'
    """
    return provider.partition(":")[0]


def flatten_rows(rows: Iterable[ResultRow]) -> dict[str, list[Any]]:
    """Columns of a table with one record per run and protocol, sorted; in the CSV's order, None for a missing value.

    A run without any score has one record, of protocol `unit`. By columns, since one shape of a thousand parts gives
    every record a thousand more.
    """
    rows = list(rows)
    metrics = {name for row in rows for scores in row.scores.values() for name in scores}
    taken = metrics | {name for row in rows for name in row.counts}
    found = [
        _sections(row, protocol, metrics, taken) for row in rows for protocol in row.scores or {DEFAULT_PROTOCOL: {}}
    ]
    found.sort(key=lambda sections: [*(sections[0][name] for name in RUN), str(sections[-1].get("label_provider"))])
    columns: list[str] = []
    for section in zip(*found, strict=True):
        names = list(dict.fromkeys(name for part in section for name in part))
        outer = list(dict.fromkeys(name.partition(".")[0] for name in names))
        columns += sorted(names, key=lambda name: (_iou_last(name), outer.index(name.partition(".")[0])))
    assert len(columns) == len(set(columns)), "`check_content` refuses the names of other columns"
    table: dict[str, list[Any]] = {name: [None] * len(found) for name in columns}
    for place, sections in enumerate(found):
        for name, value in (entry for part in sections for entry in part.items()):
            table[name][place] = value
    return table


def _sections(row: ResultRow, protocol: str, metrics: Container[str], taken: Container[str]) -> list[dict[str, Any]]:
    """A record in the groups of its columns, left to right; `taken` are the names of all metrics and counts."""
    scores = row.scores.get(protocol, {})
    run = {name: protocol if name == "protocol" else getattr(row, name) for name in RUN}
    provider = str(row.provenance.get("label_provider", UNKNOWN))
    facts = (source_of(row.shape), label_kind(provider), row.status, row.num_parts, row.steps)
    return [
        run | dict(zip(FACTS, facts, strict=True)),
        _derived(scores),
        dict(scores),
        {MEMORY: row.peak_memory_mb},
        {f"{SECONDS}{stage}": seconds for stage, seconds in row.seconds.items()},
        {f"{COUNTS}{name}" if name in metrics else name: count for name, count in row.counts.items()},
        {SCHEMA_COLUMN: row.schema},
        {f"{PROVENANCE}{name}" if name in taken else name: fact for name, fact in _flat(row.provenance).items()},
    ]


def _derived(scores: Mapping[str, float]) -> dict[str, float]:
    """The columns of `DERIVED`: ratio, difference or equality by the column's name; NaN where a side is missing."""
    derived: dict[str, float] = {}
    for name, (metric, reference) in DERIVED.items():
        a, b = scores.get(metric, math.nan), scores.get(reference, math.nan)
        if name == "parts_right" and math.isnan(scores.get("miou", math.nan)):
            a = math.nan  # the baseline's mesh has no labels, hence no count of parts
        if math.isnan(a) or math.isnan(b):
            derived[name] = math.nan
        elif name.endswith("_right"):
            derived[name] = float(a == b)
        elif "_over_" in name:
            derived[name] = a / b if b > 0 and abs(a / b) < math.inf else math.nan
        else:
            derived[name] = a - b
    return derived


def _iou_last(column: str) -> int:
    """Sort key: `iou_<k>` by k, after every other column."""
    match = IOU.fullmatch(column)
    return int(match[1]) if match else -1


def _flat(provenance: Mapping[str, Any]) -> dict[str, Any]:
    """One level of nesting as dotted names."""
    flat: dict[str, Any] = {}
    for name, value in provenance.items():
        nested = isinstance(value, Mapping) and value
        flat |= {f"{name}.{key}": item for key, item in value.items()} if nested else {name: value}
    return flat
