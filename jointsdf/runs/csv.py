"""Result rows as CSV text, one line per run and evaluation protocol, and back without loss.

Columns, left to right: the run, what is derived from its metrics, the metrics (`iou_k` last), `peak_memory_mb`,
`seconds_*`, counts, `schema`, provenance (`versions.torch` for an entry of an entry). An empty cell: the run has no
such number; `nan`: it has one that is undefined.
"""

import csv
import io
import json
import math
import re
from collections.abc import Container, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from jointsdf.runs.provenance import UNKNOWN
from jointsdf.runs.row import ResultRow, row_of

FILE = "runs.csv"
DEFAULT_PROTOCOL = "unit"
RUN = ["study", "variant", "recipe", "protocol", "head", "shape", "seed"]
FACTS = ["source", "label_kind", "status", "num_parts", "steps"]
DERIVED = {  # from a metric and what it is held against
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
    """Where a shape comes from, by its name: `abc`, `builtin` or `file`."""
    if MESH_FILE_SHAPE.fullmatch(shape):
        return "file"
    return {"abc": "abc", "part": "builtin"}.get(shape.partition("_")[0], "file")


def label_kind(provider: str) -> str:
    """Kind of a label provider, without its settings: `geometric:k=7` -> `geometric`, `file:labels.npy` -> `file`."""
    return provider.partition(":")[0]


def records(rows: Iterable[ResultRow]) -> list[dict[str, Any]]:
    """One record per run and protocol, sorted, with the columns of the CSV in its order; None for what is not there.

    A run without any score keeps one record, of protocol `unit`.
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


def rows_to_csv(rows: Sequence[ResultRow]) -> str:
    """The rows as CSV text, header first; empty for no rows."""
    lines = records(rows)
    text = io.StringIO()
    if lines:
        names = list(lines[0])
        facts = names[names.index("schema") + 1 :]
        writer = csv.DictWriter(text, names, lineterminator="\n")
        writer.writeheader()
        writer.writerows(line | {name: _encode(line[name]) for name in facts} for line in lines)
    return text.getvalue()


def rows_from_csv(text: str) -> list[ResultRow]:
    """The rows that `rows_to_csv` wrote, one per run.

    Raises:
        ValueError: The text is not such a table, or of another schema. One line, with the fix.
    """
    runs: dict[tuple[str, ...], tuple[list[str], dict[str, Any]]] = {}
    reader = csv.reader(io.StringIO(text), strict=True)
    try:
        header = next(reader, [])
        if missing := [name for name in (*RUN, *FACTS, "peak_memory_mb", "schema") if name not in header]:
            raise ValueError(f"no column {missing[0]}")
        for cells in reader:
            line = dict(zip(header, cells, strict=True))
            content, metrics = _content(header, line), _metrics(header)
            identity = (*(line[name] for name in RUN if name != "protocol"), line.get("label_provider", ""))
            facts = [line[name] for name in header if name not in (*metrics, *DERIVED, "protocol")]
            before, kept = runs.setdefault(identity, (facts, content))
            if before != facts or (kept is not content and kept["scores"].keys() & content["scores"].keys()):
                raise ValueError("contradicts an earlier line of the same run: delete one of them, or")
            kept["scores"] |= content["scores"]
        return [row_of(content) for _, content in runs.values()]
    except (ValueError, csv.Error) as error:
        raise ValueError(f"line {reader.line_num}: {error}; write the file again from its runs") from error


def read_committed(root: Path) -> tuple[list[ResultRow], list[str]]:
    """The rows of every `<study>/runs.csv` in a folder, by name, and a line for each file that cannot be read.

    Args:
        root: Folder of the studies; a missing one holds no rows.
    """
    rows: list[ResultRow] = []
    problems: list[str] = []
    for path in sorted(root.glob(f"*/{FILE}")):
        try:
            rows += rows_from_csv(path.read_text(encoding="utf-8"))
        except (ValueError, OSError) as error:
            problems.append(f"{path}: {error}")
    return rows, problems


def _sections(row: ResultRow, protocol: str, metrics: Container[str]) -> list[dict[str, Any]]:
    scores = row.scores.get(protocol, {})
    identity = {name: protocol if name == "protocol" else getattr(row, name) for name in RUN}
    provider = str(row.provenance.get("label_provider", UNKNOWN))
    facts = (source_of(row.shape), label_kind(provider), row.status, row.num_parts, row.steps)
    return [
        identity | dict(zip(FACTS, facts, strict=True)),
        _derived(scores),
        dict(scores),
        {"peak_memory_mb": row.peak_memory_mb},
        {f"{SECONDS}{stage}": seconds for stage, seconds in row.seconds.items()},
        {f"{COUNTS}{name}" if name in metrics else name: count for name, count in row.counts.items()},
        {"schema": row.schema},
        _flat(row.provenance),
    ]


def _derived(scores: Mapping[str, float]) -> dict[str, float]:
    derived: dict[str, float] = {}
    for name, (metric, reference) in DERIVED.items():
        a, b = scores.get(metric, math.nan), scores.get(reference, math.nan)
        if name == "parts_right" and math.isnan(scores.get("miou", math.nan)):
            a = math.nan  # a mesh without labels, of the baseline, has no parts to be right
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
    match = IOU.fullmatch(column)
    return int(match[1]) if match else -1


def _flat(provenance: Mapping[str, Any]) -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in provenance.items():
        assert "." not in name, name
        nested = isinstance(value, Mapping) and value
        flat |= {f"{name}.{key}": item for key, item in value.items()} if nested else {name: value}
    return flat


def _encode(value: Any) -> str:
    """A cell that `_decode` reads as the same value: JSON, but text that is not JSON stands as it is."""
    if value is None:
        return ""
    if not isinstance(value, str):
        return json.dumps(value)
    return value if value and _decode(value) == value and value[0] != '"' else json.dumps(value)


def _decode(cell: str) -> Any:
    try:
        return json.loads(cell)
    except ValueError:
        return cell


def _metrics(header: list[str]) -> list[str]:
    return [name for name in header[: header.index("peak_memory_mb")] if name not in (*RUN, *FACTS, *DERIVED)]


def _content(header: list[str], line: Mapping[str, str]) -> dict[str, Any]:
    """A line as `result.json` holds it, with the scores of its protocol only."""
    schema = header.index("schema")
    sizes = {name: line[name] for name in header[header.index("peak_memory_mb") + 1 : schema] if line[name]}
    scores = {name: float(line[name]) for name in _metrics(header) if line[name]}
    return {
        **{name: line[name] for name in ("study", "variant", "recipe", "head", "shape", "status")},
        **{name: int(line[name]) for name in ("seed", "num_parts", "steps", "schema")},
        "peak_memory_mb": float(line["peak_memory_mb"]),
        "seconds": {name.removeprefix(SECONDS): float(sizes[name]) for name in sizes if name.startswith(SECONDS)},
        "counts": {name.removeprefix(COUNTS): int(sizes[name]) for name in sizes if not name.startswith(SECONDS)},
        "scores": {line["protocol"]: scores} if scores else {},
        "provenance": _nested({name: _decode(line[name]) for name in header[schema + 1 :] if line[name]}),
    }


def _nested(flat: Mapping[str, Any]) -> dict[str, Any]:
    entries: dict[str, Any] = {}
    for name, value in flat.items():
        outer, dot, inner = name.partition(".")
        if dot:
            entries.setdefault(outer, {})[inner] = value
        else:
            entries[outer] = value
    return entries
