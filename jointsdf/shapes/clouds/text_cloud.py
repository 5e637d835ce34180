"""Point clouds in text: xyz, xyzn, xyzc, pts, csv. Numbers between spaces, tabs, commas or semicolons."""

import io
import logging
import re
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from jointsdf.errors import InputError, shown
from jointsdf.shapes.clouds.file_cloud import AXES, COLOURS, NORMALS, UNIT_LENGTH, FileCloud, cloud_of_columns
from jointsdf.shapes.readers.file_mesh import OWN_LABELS
from jointsdf.shapes.readers.formats import suffix_of

COMMENTS = ("#", "//", ";")
SEPARATORS = bytes.maketrans(b',;\t"', b"    ")
MOST_COLOUR = 255
HEAD = 10_000  # rows that tell what columns without names are

logger = logging.getLogger(__name__)


def read_text(path: Path, data: bytes) -> FileCloud:
    """Read a table of numbers, one point in each line.

    Columns have the names in the line before the first point, if there is one, also in a comment. Without names the
    first three are x, y, z; of the others three of unit length are a normal, three whole ones up to 255 a colour; the
    last of an `.xyzc` is the label; the others are `column4`, `column5`, ...

    Args:
        path: Names the file in messages; its suffix says whether the last column is a label.
        data: The file's content.

    Raises:
        InputError: It is no text, or its lines are no rows of equally many numbers, at least three.
    """
    text = decode(path, data)
    start, names = find_rows(path, text)
    table = parse_rows(path, text[start:], first_line=text.count("\n", 0, start) + 1)
    if table.shape[1] < 3:
        raise InputError(f"{path} has {table.shape[1]} numbers in each line: x, y and z are needed")
    if names is None or len(names) != table.shape[1]:
        names = _guess_names(table, labels_last=suffix_of(path) == "xyzc")
    return cloud_of_columns(str(path), dict(zip(names, table.T, strict=True)))


def decode(path: Path, data: bytes) -> str:
    """Text with spaces between its words.

    Raises:
        InputError: It is no text.
    """
    if b"\0" in data:
        raise InputError(f"{path} is no text: name it as what it is, or export it as PLY")
    return data.removeprefix(b"\xef\xbb\xbf").translate(SEPARATORS).decode("utf-8", errors="replace")


def find_rows(path: Path, text: str) -> tuple[int, list[str] | None]:
    """Where the rows begin in a text of `decode`, and the names in the line before them.

    Raises:
        InputError: There are no rows of numbers.
    """
    place, names = 0, None
    for line in text.splitlines(keepends=True):
        words = line.strip().removeprefix("//").lstrip("#; ").split()
        commented = line.lstrip().startswith(COMMENTS)
        if words and not commented and all(map(_is_number, words)):
            if len(words) > 1:
                return place, names
        elif words and set(AXES) <= {word.lower() for word in words}:
            names = words
        elif words and not commented:
            break
        place += len(line)
    raise InputError(f"{path} has {shown(text[place:].strip().partition(chr(10))[0], 40)!r} where x y z is needed")


def _is_number(word: str) -> bool:
    return (
        re.fullmatch(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?|[-+]?(nan|inf(inity)?)", word, re.IGNORECASE) is not None
    )


def parse_rows(path: Path, text: str, first_line: int) -> Float[ndarray, "n c"]:
    """Numbers of rows of text.

    Args:
        path: Names the file in messages.
        text: Of `decode`, from the first row on.
        first_line: Number of its first line in the file.

    Raises:
        InputError: The rows are not of equally many numbers.
    """
    try:
        return np.loadtxt(io.StringIO(text), ndmin=2, comments=COMMENTS)
    except ValueError as error:
        row, from_one = re.search(r"at row (\d+)", str(error)), "changed" in str(error)  # else rows count from 0
        where = f" near line {first_line + int(row[1]) - from_one}" if row else ""
        raise InputError(f"{path}: rows of equally many numbers are needed{where}: export it again") from error


def _guess_names(table: Float[ndarray, "n c"], *, labels_last: bool) -> list[str]:
    """Names of columns that have none."""
    head, width = table[:HEAD], table.shape[1] - labels_last
    names = list(AXES)
    normals, colours = list(NORMALS[:1]), list(COLOURS[:1])
    while len(names) < width:
        three = head[:, len(names) : len(names) + 3]
        whole = len(names) + 3 <= width
        if whole and normals and (np.abs(np.linalg.norm(three, axis=1) - 1) < UNIT_LENGTH).mean() > 0.9:
            names += normals.pop()
        elif whole and colours and (three == np.rint(three)).all() and three.min() >= 0 and three.max() <= MOST_COLOUR:
            names += colours.pop()
        else:
            names.append(f"column{len(names) + 1}")
    return [*names[:width], *([OWN_LABELS] if labels_last else [])]
