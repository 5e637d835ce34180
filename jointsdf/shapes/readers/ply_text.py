"""Tables of a text PLY file."""

from pathlib import Path

import numpy as np
from jaxtyping import Shaped
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.shapes.readers.ply_header import Element, Header, Property
from jointsdf.shapes.readers.ply_table import PLURALS, Lists, Table, truncated
from jointsdf.shapes.readers.text_numbers import parse_floats, parse_integers, split_rows, warn_unless_ended


def read_text(path: Path, header: Header, data: bytes) -> dict[str, Table]:
    """Read the tables of a text PLY file, one row a line.

    Args:
        path: Names the file in messages.
        header: Of the file.
        data: The file's content.

    Raises:
        InputError: A table is cut or damaged, or there is more than the header declares.
    """
    lines = split_rows(data[header.size :])
    tables: dict[str, Table] = {}
    at = 0
    for element in header.elements:
        if not element.properties or not element.rows:
            continue
        rows = lines[at : at + element.rows]
        at += len(rows)
        tables[element.name] = _parse_rows(path, element, rows)
    if at < len(lines):
        raise InputError(f"{path} is damaged: {len(lines) - at} lines follow its declared rows; export it again")
    warn_unless_ended(str(path), data)
    return tables


def _parse_rows(path: Path, element: Element, rows: list[list[bytes]]) -> Table:
    """Parse the rows of one element."""
    table = Table()
    widths = np.array([len(row) for row in rows], dtype=np.int64)
    words = [word for row in rows for word in row]
    starts = np.cumsum(widths) - widths
    at = starts.copy()  # of the next property of each row
    for column in element.properties:
        sizes = np.ones(len(rows), dtype=np.int64)
        if column.count:
            _check_room(path, element, at + 1 <= starts + widths)
            sizes = parse_integers(str(path), [words[i] for i in at.tolist()])
            at += 1
        _check_room(path, element, (sizes >= 0) & (sizes <= starts + widths - at))
        within = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
        values = _convert(path, column, [words[i] for i in (np.repeat(at, sizes) + within).tolist()])
        at += sizes
        if column.count:
            table.lists[column.name] = Lists(values, sizes)
        else:
            table.scalars[column.name] = values
    _check_room(path, element, at == starts + widths)
    if len(rows) < element.rows:
        raise truncated(path, element, len(rows))
    return table


def _check_room(path: Path, element: Element, fits: Shaped[ndarray, " r"]) -> None:
    """Refuse rows that have other numbers than the header and their lists declare."""
    if fits.all():
        return
    row = int(np.argmin(fits))
    if row == len(fits) - 1:
        raise truncated(path, element, row)
    raise InputError(
        f"{path} is damaged: row {row} of its {element.rows} {PLURALS.get(element.name, element.name)} has too few or "
        "too many numbers; export it again"
    )


def _convert(path: Path, column: Property, words: list[bytes]) -> Shaped[ndarray, " n"]:
    """The numbers of a property in its type; text may hold more digits than `float`, and they are kept."""
    if column.kind.startswith("f"):
        return parse_floats(str(path), words)
    values = parse_integers(str(path), words)
    limits = np.iinfo(column.kind)
    if values.size and (values.min() < limits.min or values.max() > limits.max):
        raise InputError(f"{path} is damaged: its {column.name} is beyond {limits.min}..{limits.max}; export it again")
    return values.astype(column.kind)
