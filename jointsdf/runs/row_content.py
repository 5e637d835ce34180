"""Content of a result.json, checked: the right keys, and of each value the type and the bounds. Imports no torch."""

import re
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from jointsdf.errors import shown
from jointsdf.runs.columns import check_count, check_fact, check_metric, check_name
from jointsdf.runs.stored_json import MOST_CHARACTERS, number, whole

SCHEMA = 1
STATUSES = ("ok", "empty_mesh")
LONGEST_FOLDER = 255  # bytes; file systems allow no longer names
LARGEST = 1e100  # of a score, whose square is finite
LONGEST_TIME = 1e12  # seconds
TEXTS = ("label_provider", "mesh_sha256", "config_hash", "settings_hash", "machine", "device", "matmul")
CONTROLS = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]")  # act on a terminal, or break a line
AGAIN = "delete the file and run that fit again"


def check_content(content: Any) -> dict[str, Any]:
    """The content as the fields of a `ResultRow`: numbers as floats, null ones as NaN.

    Args:
        content: Parsed JSON; not changed.

    Raises:
        ValueError: It is not a row of this schema. One line, with the fix.
    """
    if not isinstance(content, Mapping) or type(content.get("schema")) is not int:
        raise ValueError(f"no schema number in it; {AGAIN}")
    if content["schema"] != SCHEMA:
        newer = content["schema"] > SCHEMA
        fix = f"newer than {SCHEMA}: update jointsdf" if newer else f"older than {SCHEMA}: {AGAIN}"
        raise ValueError(f"schema {content['schema']} is {fix}")
    if names := sorted(FIELDS.keys() ^ content.keys()):
        raise ValueError(f"missing or unknown keys: {shown(', '.join(names))}; {AGAIN}")
    return {name: _read(name, read, content[name]) for name, read in FIELDS.items()}


def is_folder_name(name: Any) -> bool:
    """Whether the value can name a folder, on a line of its own.

    >>> [is_folder_name(name) for name in ("main", "a/b", "..", "")]
    [True, False, False, False]
    """
    if not isinstance(name, str) or name in ("", ".", "..") or "/" in name or CONTROLS.search(name):
        return False
    return len(name.encode()) <= LONGEST_FOLDER


def _read(name: str, read: Callable[[Any], Any], value: Any) -> Any:
    try:
        return read(value)
    except ValueError as error:
        raise ValueError(f"{name}: {error}; {AGAIN}") from error


def _folder_name(value: Any) -> str:
    if not is_folder_name(value):
        raise ValueError(f"{shown(repr(value))} names no folder")
    return str(value)


def read_scores(value: Any) -> dict[str, dict[str, float]]:
    """Scores by protocol and metric, checked; null ones as NaN.

    Raises:
        ValueError: The value is something else. One line.
    """
    return _entries(check_name, partial(_entries, check_metric, partial(number, low=-LARGEST, high=LARGEST)), value)


def _status(value: Any) -> str:
    if value not in STATUSES:
        raise ValueError(f"{shown(repr(value))} is none of {', '.join(STATUSES)}")
    return str(value)


def _entries(check: Callable[[str], None], read: Callable[[Any], Any], value: Any) -> dict[str, Any]:
    """An object's values, read, by its names, checked."""
    if not isinstance(value, Mapping):
        raise ValueError(f"what is of type {type(value).__name__} is no object")
    entries, name = {}, ""
    try:
        for name, item in value.items():
            check(name)
            entries[name] = read(item)
    except ValueError as error:
        raise ValueError(f"{shown(name)}: {error}") from error
    return entries


def _fact(value: Any, *, nested: bool = True) -> Any:
    if nested and isinstance(value, Mapping):
        return _entries(check_name, partial(_fact, nested=False), value)
    if isinstance(value, str) and len(value) <= MOST_CHARACTERS:
        return value
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, int):
        number(value, -LARGEST, LARGEST)
        return value
    if isinstance(value, float):
        return number(value, -LARGEST, LARGEST)
    raise ValueError(f"what is of type {type(value).__name__} is no fact")


def _provenance(value: Any) -> dict[str, Any]:
    facts = _entries(check_fact, _fact, value)
    for name in TEXTS:
        if not isinstance(facts.get(name, ""), str):
            raise ValueError(f"{name} is no text")
    return facts


_seconds = partial(number, low=0, high=LONGEST_TIME)
FIELDS: dict[str, Callable[[Any], Any]] = {
    **dict.fromkeys(("study", "variant", "recipe", "head", "shape"), _folder_name),
    **dict.fromkeys(("seed", "steps", "num_parts", "schema"), whole),
    "status": _status,
    "counts": partial(_entries, check_count, whole),
    "seconds": partial(_entries, check_name, _seconds),
    "peak_memory_mb": partial(number, low=0, high=LARGEST),
    "scores": read_scores,
    "provenance": _provenance,
}
