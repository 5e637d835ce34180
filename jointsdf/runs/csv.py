"""Result rows as CSV text and back without loss; the columns are those of `records`.

An empty cell: the run has no such number; `nan`: it has one that is undefined.
"""

import csv
import io
import json
import os
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from jointsdf.errors import DamagedFile, shown
from jointsdf.runs.columns import CACHED, COUNTS, DERIVED, FACTS, MEMORY, PROVENANCE, RUN, SCHEMA_COLUMN, SECONDS
from jointsdf.runs.records import flatten_rows
from jointsdf.runs.row import ResultRow, parse_row
from jointsdf.runs.stored_json import read_regular

FILE = "runs.csv"
MOST_BYTES = 1 << 28  # of 100,000 rows


def rows_to_csv(rows: Sequence[ResultRow]) -> str:
    """The rows as CSV text, header first; empty for no rows."""
    table, text = flatten_rows(rows), io.StringIO()
    names = list(table)
    if names:
        facts = set(names[names.index(SCHEMA_COLUMN) + 1 :])
        columns = (map(_encode, column) if name in facts else column for name, column in table.items())
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(names)
        writer.writerows(zip(*columns, strict=True))
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
        if missing := [name for name in (*RUN, *FACTS, MEMORY, SCHEMA_COLUMN) if name not in header]:
            raise ValueError(f"no column {missing[0]}")
        if len(set(header)) < len(header):
            raise ValueError("a column is there twice")
        metrics = _metrics(header)
        of_run = [name for name in header if name not in (*metrics, *DERIVED, "protocol")]
        for cells in reader:
            line = dict(zip(header, cells, strict=True))
            content = _content(header, metrics, line)
            provider = str(content["provenance"].get("label_provider"))
            key = (*(line[name] for name in RUN if name != "protocol"), provider)
            facts = [line[name] for name in of_run]
            facts_before, run = runs.setdefault(key, (facts, content))
            if facts_before != facts or (run is not content and run["scores"].keys() & content["scores"].keys()):
                raise ValueError("contradicts an earlier line of the same run: delete one of them, or")
            run["scores"] |= content["scores"]
        return [parse_row(content) for _, content in runs.values()]
    except (ValueError, csv.Error, RecursionError) as error:
        raise ValueError(f"line {reader.line_num}: {shown(error, 300)}; write the file again from its runs") from error


def read_committed(root: Path) -> tuple[list[ResultRow], list[str]]:
    """Read every `<study>/runs.csv` in a folder, sorted by study.

    Args:
        root: Folder of the studies; a missing one holds no rows.

    Returns:
        The rows, and a line for each file that cannot be read.
    """
    rows: list[ResultRow] = []
    problems: list[str] = []
    for path in sorted(folder / FILE for folder in root.glob("*") if os.path.lexists(folder / FILE)):
        try:
            rows += read_csv(path)
        except DamagedFile as error:
            problems.append(str(error))
    return rows, problems


def read_csv(path: Path) -> list[ResultRow]:
    """Read a file that `rows_to_csv` wrote.

    Raises:
        DamagedFile: It is another file, or cannot be read.
    """
    try:
        return rows_from_csv(read_regular(path, MOST_BYTES).decode("utf-8"))
    except OSError as error:
        raise DamagedFile(f"{shown(path, 4000)}: it cannot be opened ({error.strerror})") from error
    except ValueError as error:
        raise DamagedFile(f"{shown(path, 4000)}: {error}") from error


def _encode(value: Any) -> str:
    """A cell that `_decode` reads as the same value: JSON, but text that is not JSON is left as it is."""
    if value is None:
        return ""
    return _encode_text(value) if isinstance(value, str) else json.dumps(value)


@lru_cache(CACHED)
def _encode_text(value: str) -> str:
    return value if value and _decode(value) == value and value[0] != '"' else json.dumps(value)


def _decode(cell: str) -> Any:
    try:
        return json.loads(cell)
    except ValueError:
        return cell


def _metrics(header: list[str]) -> list[str]:
    """The metrics' columns: left of the memory, without the run, its facts and what is derived."""
    return [name for name in header[: header.index(MEMORY)] if name not in (*RUN, *FACTS, *DERIVED)]


def _content(header: list[str], metrics: list[str], line: Mapping[str, str]) -> dict[str, Any]:
    """A line in the layout of `result.json`, with the scores of its protocol only."""
    schema = header.index(SCHEMA_COLUMN)
    sizes = {name: line[name] for name in header[header.index(MEMORY) + 1 : schema] if line[name]}
    scores = {name: float(line[name]) for name in metrics if line[name]}
    return {
        **{name: line[name] for name in ("study", "variant", "recipe", "head", "shape", "status")},
        **{name: int(line[name]) for name in ("seed", "num_parts", "steps", "schema")},
        MEMORY: float(line[MEMORY]),
        "seconds": {name.removeprefix(SECONDS): float(sizes[name]) for name in sizes if name.startswith(SECONDS)},
        "counts": {name.removeprefix(COUNTS): int(sizes[name]) for name in sizes if not name.startswith(SECONDS)},
        "scores": {line["protocol"]: scores} if scores else {},
        "provenance": _nested({name: _decode(line[name]) for name in header[schema + 1 :] if line[name]}),
    }


def _nested(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Dotted names as one level of nesting."""
    entries: dict[str, Any] = {}
    for name, value in flat.items():
        outer, dot, inner = name.removeprefix(PROVENANCE).partition(".")
        if not dot:
            entries[outer] = value
        elif isinstance(held := entries.setdefault(outer, {}), dict):
            held[inner] = value
        else:
            raise ValueError(f"column {name} stands beside {outer}")
    return entries
