"""Result rows as flat records, one per run and evaluation protocol: the columns of the CSV and of every table.

Columns, left to right: the run, what is derived from its metrics, the metrics (`iou_k` last), `peak_memory_mb`,
`seconds_*`, counts, `schema`, provenance (`versions.torch` for an entry of an entry).
"""

import math
import re
from collections.abc import Container, Iterable, Mapping
from typing import Any

from jointsdf.runs.provenance import UNKNOWN
from jointsdf.runs.row import ResultRow

DEFAULT_PROTOCOL = "unit"
RUN = ["study", "variant", "recipe", "protocol", "head", "shape", "seed"]
FACTS = ["source", "label_kind", "status", "num_parts", "steps"]
DERIVED = {  # from a metric and its reference
    "cd_l1_over_floor": ("cd_l1", "cd_l1_floor"),
    "nc_minus_floor": ("nc", "nc_floor"),
    "f1_over_floor": ("f1", "f1_floor"),
    "miou_minus_floor": ("miou", "miou_floor"),
    "acc_minus_floor": ("acc", "acc_floor"),
    "consistency_minus_floor": ("consistency", "consistency_floor"),
    "miou_exact_over_ceiling": ("miou_exact", "miou_exact_ceiling"),
    "pieces_right": ("components", "components_gt"),
    "euler_right": ("euler", "euler_gt"),
    "parts_right": ("parts_pred", "parts_gt"),
}
IOU = re.compile(r"iou_(\d+)")
MESH_FILE_SHAPE = re.compile(r".*-[0-9a-f]{6}")  # `<stem>-<6 hex digits>`, whatever the stem
SECONDS = "seconds_"
COUNTS = "counts."  # before a count that has a metric's name


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


def flatten_rows(rows: Iterable[ResultRow]) -> list[dict[str, Any]]:
    """One record per run and protocol, sorted, with the same columns in the CSV's order; None for a missing value.

    A run without any score has one record, of protocol `unit`.
    """
    rows = list(rows)
    metrics = {name for row in rows for scores in row.scores.values() for name in scores}
    found = [_sections(row, protocol, metrics) for row in rows for protocol in row.scores or {DEFAULT_PROTOCOL: {}}]
    found.sort(key=lambda sections: [*(sections[0][name] for name in RUN), str(sections[-1].get("label_provider"))])
    columns: list[str] = []
    for section in zip(*found, strict=True):
        names = list(dict.fromkeys(name for part in section for name in part))
        outer = list(dict.fromkeys(name.partition(".")[0] for name in names))
        columns += sorted(names, key=lambda name: (_iou_last(name), outer.index(name.partition(".")[0])))
    assert len(columns) == len(set(columns)), "a metric, count or provenance entry has the name of another column"
    lines = [{name: value for part in sections for name, value in part.items()} for sections in found]
    return [{name: line.get(name) for name in columns} for line in lines]


def _sections(row: ResultRow, protocol: str, metrics: Container[str]) -> list[dict[str, Any]]:
    """A record in the groups of its columns, left to right."""
    scores = row.scores.get(protocol, {})
    run = {name: protocol if name == "protocol" else getattr(row, name) for name in RUN}
    provider = str(row.provenance.get("label_provider", UNKNOWN))
    facts = (source_of(row.shape), label_kind(provider), row.status, row.num_parts, row.steps)
    return [
        run | dict(zip(FACTS, facts, strict=True)),
        _derived(scores),
        dict(scores),
        {"peak_memory_mb": row.peak_memory_mb},
        {f"{SECONDS}{stage}": seconds for stage, seconds in row.seconds.items()},
        {f"{COUNTS}{name}" if name in metrics else name: count for name, count in row.counts.items()},
        {"schema": row.schema},
        _flat(row.provenance),
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
            derived[name] = a / b if b > 0 else math.nan
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
        assert "." not in name, name
        nested = isinstance(value, Mapping) and value
        flat |= {f"{name}.{key}": item for key, item in value.items()} if nested else {name: value}
    return flat
