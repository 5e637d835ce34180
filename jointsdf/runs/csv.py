"""Result rows as CSV text and back without loss; the columns are those of `records`.

An empty cell: the run has no such number; `nan`: it has one that is undefined.
"""

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jointsdf.runs.records import COUNTS, DERIVED, FACTS, RUN, SECONDS, flatten_rows
from jointsdf.runs.row import ResultRow, parse_row

FILE = "runs.csv"


def rows_to_csv(rows: Sequence[ResultRow]) -> str:
    """The rows as CSV text, header first; empty for no rows."""
    lines = flatten_rows(rows)
    text = io.StringIO()
    if lines:
        names = list(lines[0])
        facts = names[names.index("schema") + 1 :]
        writer = csv.DictWriter(text, names, lineterminator="\n")
        writer.writeheader()
        writer.writerows(line | {name: _encode(line[name]) for name in facts} for line in lines)
    return text.getvalue()


def rows_from_csv(text: str) -> list[ResultRow]:
    """Parse what `rows_to_csv` wrote, one row per run.

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
            key = (*(line[name] for name in RUN if name != "protocol"), line.get("label_provider", ""))
            facts = [line[name] for name in header if name not in (*metrics, *DERIVED, "protocol")]
            facts_before, run = runs.setdefault(key, (facts, content))
            if facts_before != facts or (run is not content and run["scores"].keys() & content["scores"].keys()):
                raise ValueError("contradicts an earlier line of the same run: delete one of them, or")
            run["scores"] |= content["scores"]
        return [parse_row(content) for _, content in runs.values()]
    except (ValueError, csv.Error) as error:
        raise ValueError(f"line {reader.line_num}: {error}; write the file again from its runs") from error


def read_committed(root: Path) -> tuple[list[ResultRow], list[str]]:
    """Read every `<study>/runs.csv` in a folder, sorted by study.

    Args:
        root: Folder of the studies; a missing one holds no rows.

    Returns:
        The rows, and a line for each file that cannot be read.
    """
    rows: list[ResultRow] = []
    problems: list[str] = []
    for path in sorted(root.glob(f"*/{FILE}")):
        try:
            rows += rows_from_csv(path.read_text(encoding="utf-8"))
        except (ValueError, OSError) as error:
            problems.append(f"{path}: {error}")
    return rows, problems


def _encode(value: Any) -> str:
    """A cell that `_decode` reads as the same value: JSON, but text that is not JSON is left as it is."""
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
    """The metrics' columns: left of the memory, without the run, its facts and what is derived."""
    return [name for name in header[: header.index("peak_memory_mb")] if name not in (*RUN, *FACTS, *DERIVED)]


def _content(header: list[str], line: Mapping[str, str]) -> dict[str, Any]:
    """A line in the layout of `result.json`, with the scores of its protocol only."""
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
    """Dotted names as one level of nesting."""
    entries: dict[str, Any] = {}
    for name, value in flat.items():
        outer, dot, inner = name.partition(".")
        if dot:
            entries.setdefault(outer, {})[inner] = value
        else:
            entries[outer] = value
    return entries
