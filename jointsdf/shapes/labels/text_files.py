"""Numbers in text: one per line, with the index of its face, or as JSON. UTF-8 and UTF-16."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from jointsdf.errors import InputError, first_line
from jointsdf.shapes.labels.array_files import read_bytes
from jointsdf.shapes.labels.contents import decode_text, describe_content
from jointsdf.shapes.labels.face_order import FORMAT
from jointsdf.shapes.readers.formats import suffix_of

NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
BETWEEN = re.compile(r"\s*[,;]\s*|\s+")
RULE = "write one integer per line, or face and integer"
BY_CONTENT = {"a .npy array": "name it .npy", "a zip archive (.npz?)": "name it .npz if it is one"}


def read_text(path: Path) -> Float[ndarray, " n"]:
    """Read the numbers in the lines of a text file: one in each, or a face's index and its number; or all in one line.

    Commas, semicolons and space separate. Lines that begin with # come first, if any; in a `.csv` then a line of names.

    Raises:
        InputError: The file is no text, empty, or not of such lines.
    """
    source = f"labels file {path}"
    rows = _parse_rows(source, _decode(path), names_allowed=suffix_of(path) == "csv")
    if rows.shape[1] == 2 and len(rows) > 1:
        return _order(source, rows[:, 0], rows[:, 1])
    if rows.shape[1] > 2 and len(rows) > 1:
        raise InputError(f"{source} has {rows.shape[1]} numbers in each line: {RULE}")
    return rows.reshape(-1)


def read_table(path: Path) -> Float[ndarray, "n c"]:
    """Read lines of equally many numbers; separators and comments as of `read_text`.

    Raises:
        InputError: The file is no text, empty, or not of such lines.
    """
    return _parse_rows(f"labels file {path}", _decode(path), names_allowed=True)


def read_json(path: Path) -> Float[ndarray, " n"]:
    """Read JSON: a list of one number per face, an object of faces' indices and numbers, or either named `labels`.

    Raises:
        InputError: The file is no JSON, or of none of these.
    """
    source = f"labels file {path}"
    rule = 'write [3, 0, ..], {"0": 3, ..} or {"labels": [3, 0, ..]}'
    try:
        given = json.loads(_decode(path), object_pairs_hook=_refuse_repeated)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{source} is no JSON (truncated or damaged?), {first_line(error)}: {rule}") from error
    if isinstance(given, dict) and given.get("format") == FORMAT:
        raise InputError(f"{source} only says what {given.get('labels')} belongs to: give labels={given.get('labels')}")
    labels = given["labels"] if isinstance(given, dict) and "labels" in given else given
    if isinstance(labels, dict):
        if (odd := next((key for key in labels if not re.fullmatch("[0-9]{1,15}", key)), None)) is not None:
            raise InputError(f"{source} has the key {odd[:40]!r}: {rule}")
        faces, labels = np.array([float(key) for key in labels]), list(labels.values())
    else:
        faces = None
    if not isinstance(labels, list) or not labels:
        raise InputError(f"{source} holds no list of labels: {rule}")
    values = _to_numbers(source, rule, labels)
    return values if faces is None else _order(source, faces, values)


def _to_numbers(source: str, rule: str, given: list[Any]) -> Float[ndarray, " n"]:
    for value in given:
        if not isinstance(value, int | float):
            raise InputError(f"{source} holds {str(value)[:40]!r}: {rule}")
    try:
        return np.array([float(value) for value in given])
    except OverflowError as error:
        raise InputError(f"{source} holds a number of hundreds of digits: {rule}") from error


def _refuse_repeated(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    if len(found := dict(pairs)) < len(pairs):
        raise ValueError("it has a key twice")
    return found


def _order(source: str, faces: Float[ndarray, " n"], values: Float[ndarray, " n"]) -> Float[ndarray, " n"]:
    """The values in the order of their faces, each of which occurs once."""
    order = np.argsort(faces, kind="stable")
    if (faces[order] != np.arange(len(faces))).any():
        raise InputError(f"{source} must name each of the faces 0 to {len(faces) - 1} once beside its label: {RULE}")
    return values[order]


def _decode(path: Path) -> str:
    data = read_bytes(path)
    text, found = decode_text(data), describe_content(data)
    if found == "empty":
        raise InputError(f"labels file {path} is empty: {RULE}")
    if text is None or found != "text":
        raise InputError(f"labels file {path} is no text but {found}: {BY_CONTENT.get(found, RULE)}")
    return text


def _parse_rows(source: str, text: str, *, names_allowed: bool) -> Float[ndarray, "n c"]:
    """Parse lines of equally many numbers; blank lines at the end do not count."""
    lines = text.rstrip().splitlines()
    first = next((i for i, line in enumerate(lines) if not line.lstrip().startswith("#")), len(lines))
    words = [BETWEEN.split(line.replace('"', "").strip()) for line in lines[first:]]
    if names_allowed and words and not any(map(NUMBER.fullmatch, words[0])):
        first, words = first + 1, words[1:]
    if not words:
        raise InputError(f"{source} is empty: {RULE}")
    for number, row in enumerate(words, start=first + 1):
        if len(row) != len(words[0]) or not all(map(NUMBER.fullmatch, row)):
            raise InputError(f"{source} has {lines[number - 1].strip()[:40]!r} in line {number}: {RULE}")
    return np.array(words, dtype=np.float64)
