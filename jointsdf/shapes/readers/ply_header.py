"""Header of a PLY file (G. Turk, "The PLY Polygon File Format", 1994): its elements, their properties, its comments."""

import re
from dataclasses import dataclass
from pathlib import Path

from jointsdf.errors import InputError

ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4",
    "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip
LONGEST = 1 << 20  # bytes of a header
END = re.compile(rb"(?:^|[\r\n])[ \t]*end_header[ \t]*(\r\n|\r|\n)")
MOST_DIGITS = 18  # of a count


@dataclass(frozen=True)
class Property:
    """A property of an element.

    Attributes:
        name: Of the property.
        kind: numpy's code of its numbers, e.g. `f4`.
        count: The code of a list's length; "" for a scalar.
    """

    name: str
    kind: str
    count: str = ""


@dataclass(frozen=True)
class Element:
    """A table of the file.

    Attributes:
        name: e.g. `vertex`.
        rows: Their declared number.
        properties: The columns.
    """

    name: str
    rows: int
    properties: tuple[Property, ...]


@dataclass(frozen=True)
class Header:
    """A PLY file's header.

    Attributes:
        order: Byte order of the numbers, `<` or `>`; "" for text.
        elements: Tables in the file's order.
        comments: Texts of its comment lines.
        size: Bytes of the header: the data begin here.
    """

    order: str
    elements: tuple[Element, ...]
    comments: tuple[str, ...]
    size: int


def parse_header(path: Path, data: bytes) -> Header:
    """Parse the header of a PLY file.

    Args:
        path: Names the file in messages.
        data: The file's content.

    Raises:
        InputError: It is no PLY file, or its header is cut, damaged, or of a type that is not known.
    """
    end = END.search(data, 0, LONGEST)
    if not data.startswith(b"ply") or not end:
        what = "has no end_header" if data.startswith(b"ply") else "does not begin with ply"
        raise InputError(f"{path} cannot be read as ply (truncated or damaged?): it {what}; export it again")
    after = end.end()
    if end[1] == b"\r\n" and data[3:4] == b"\r" and data[4:5] != b"\n":
        after -= 1  # lines end in CR alone: the LF belongs to the data
    order, elements, comments = None, [], []
    for line in data[: end.start()].decode("latin-1").splitlines()[1:]:
        word, _, rest = line.strip().partition(" ")
        words = rest.split()
        try:
            if word == "format":
                order = ORDERS[words[0]]
            elif word == "comment":
                comments.append(rest.strip())
            elif word == "element":
                name, count = words
                elements.append((name, _parse_count(count), list[Property]()))
            elif word == "property":
                elements[-1][2].append(_parse_property(words))
            elif word not in ("obj_info", ""):
                raise ValueError
        except (ValueError, KeyError, IndexError):
            shown = line.strip()[:60]
            raise InputError(f"{path} cannot be read as ply: its header has {shown!r}; export it again") from None
    tables = tuple(Element(name, rows, tuple(properties)) for name, rows, properties in elements)
    if order is None:
        raise InputError(f"{path} cannot be read as ply: its header has no format; export it again")
    _refuse_doubles(path, [each.name for each in tables])
    for each in tables:
        _refuse_doubles(path, [column.name for column in each.properties])
    return Header(order, tables, tuple(comments), after)


def _parse_count(word: str) -> int:
    if not word.isdecimal() or len(word) > MOST_DIGITS:
        raise ValueError
    return int(word)


def _parse_property(words: list[str]) -> Property:
    if words[0] != "list":
        kind, name = words
        return Property(name, TYPES[kind])
    _, count, kind, name = words
    if TYPES[count][0] == "f":
        raise ValueError
    return Property(name, TYPES[kind], TYPES[count])


def _refuse_doubles(path: Path, names: list[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{path} cannot be read as ply: its header declares {name} twice; export it again")
