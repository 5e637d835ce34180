"""Tables of a binary PLY file.

Rows of one size, as those of triangles, are a numpy array as they stand. Others are walked row by row, for the places
of their lists alone, after which numpy gathers the numbers.
"""

import struct
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Shaped
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.shapes.readers.ply_header import Element, Header, Property
from jointsdf.shapes.readers.ply_table import Lists, Table, truncated

CODES = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q"}


def read_binary(path: Path, header: Header, data: bytes) -> dict[str, Table]:
    """Read the tables of a binary PLY file.

    Memory and time are bounded by the file's size, whatever its header declares.

    Args:
        path: Names the file in messages.
        header: Of the file.
        data: The file's content.

    Raises:
        InputError: A table is cut or damaged, or there is more than the header declares.
    """
    tables: dict[str, Table] = {}
    at = header.size
    for element in header.elements:
        if element.properties and element.rows:
            columns, at = _read_equal_rows(element, header.order, data, at) or _read_rows(
                path, element, header.order, data, at
            )
            tables[element.name] = columns
    if data[at:].strip(b"\0\r\n\t \x1a"):
        raise InputError(f"{path} is damaged: {len(data) - at} bytes follow its declared rows; export it again")
    return tables


def _read_equal_rows(element: Element, order: str, data: bytes, at: int) -> tuple[Table, int] | None:
    """Read rows that all have lists as long as the first row's; None where they have not, or end early."""
    row, place = [], at
    for number, column in enumerate(element.properties):
        length = 1
        if column.count:
            width = int(column.count[1])
            length = int.from_bytes(data[place : place + width], "little" if order == "<" else "big")
            row.append((f"count{number}", order + column.count))
            place += width
        row.append((f"{number}", order + column.kind, *((length,) if column.count else ())))
        place += length * int(column.kind[1])
        if place > len(data):
            return None
    kind = np.dtype(row)
    end = at + element.rows * kind.itemsize
    if end > len(data):
        return None
    rows = np.frombuffer(data, kind, element.rows, at)
    table = Table()
    for number, column in enumerate(element.properties):
        values = rows[f"{number}"]
        if not column.count:
            table.scalars[column.name] = _native(values)
            continue
        sizes = rows[f"count{number}"].astype(np.int64)
        if (sizes != sizes[0]).any():
            return None
        table.lists[column.name] = Lists(_native(values).reshape(-1), sizes)
    return table, end


def _read_rows(path: Path, element: Element, order: str, data: bytes, at: int) -> tuple[Table, int]:
    """Read rows of differing sizes."""
    places: list[int] = []  # of each property of each row: its first number, and how many
    width = len(element.properties)
    for row in _walk_rows(element.properties, element.rows, order, data, at):
        places += row
    held = len(places) // (2 * width)
    starts, sizes = np.array(places, dtype=np.int64).reshape(held, width, 2).transpose(2, 1, 0)
    if (sizes < 0).any():
        raise InputError(f"{path} is damaged: a list of its {element.name} has a negative length; export it again")
    if held < element.rows:
        raise truncated(path, element, held)
    table, raw = Table(), np.frombuffer(data, np.uint8)
    for column, start, size in zip(element.properties, starts, sizes, strict=True):
        item = int(column.kind[1])
        within = np.arange(size.sum()) - np.repeat(np.cumsum(size) - size, size)
        first = np.repeat(start, size) + item * within
        values = _native(raw[first[:, None] + np.arange(item)].reshape(-1).view(order + column.kind))
        if column.count:
            table.lists[column.name] = Lists(values, size)
        else:
            table.scalars[column.name] = values
    return table, int(starts[-1, -1] + sizes[-1, -1] * int(element.properties[-1].kind[1]))


def _walk_rows(
    properties: Sequence[Property], rows: int, order: str, data: bytes, at: int
) -> Iterator[tuple[int, ...]]:
    """Place and length of each property, row by row, until the data end or a length is negative."""
    plan = [
        (int(column.kind[1]), int(column.count[1]), struct.Struct(order + CODES[column.count]).unpack_from)
        if column.count
        else (int(column.kind[1]), 0, None)
        for column in properties
    ]
    end = len(data)
    for _ in range(rows):
        row: list[int] = []
        for item, width, unpack in plan:
            length = 1
            if unpack:
                if at + width > end:
                    return
                length = unpack(data, at)[0]
                at += width
            row += (at, length)
            at += length * item
        if at > end:
            return
        yield tuple(row)
        if min(row[1::2]) < 0:
            return


def _native(values: Shaped[ndarray, "..."]) -> Shaped[ndarray, "..."]:
    """The same numbers in this machine's byte order."""
    return np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("="))
