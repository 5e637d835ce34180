"""Points of a file, piece by piece: text and npy files of any size in constant memory, other formats as a whole."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.shapes.clouds.cloud_file import READERS, read_cloud
from jointsdf.shapes.clouds.file_cloud import AXES
from jointsdf.shapes.clouds.text_cloud import decode, find_rows, parse_rows, read_text
from jointsdf.shapes.readers.content import require_file
from jointsdf.shapes.readers.formats import suffix_of

PIECE = 1 << 16  # points of a piece
BLOCK = 1 << 20  # bytes of text of a piece; also holds what comes before the first point


class Piece(NamedTuple):
    """Points of a file, one after another.

    Attributes:
        points: Their coordinates, finite.
        share: Of the file that was read with them, 0..1.
    """

    points: Float[ndarray, "n 3"]
    share: float


def read_pieces(path: Path) -> Iterator[Piece]:
    """Read the points of a file in its order.

    Args:
        path: Text with x, y, z in its first columns or in those that its header names so; npy of shape (n, 3 or more)
            or with fields x, y, z; or another point file; of a PLY mesh its vertices.

    Raises:
        InputError: The file is missing, damaged, of another format, or has a point that is not finite.
    """
    require_file(path)
    suffix = suffix_of(path)
    if suffix not in READERS:
        raise InputError(f"{path}: no file of points; give one of {', '.join(READERS)}")
    compressed = path.suffix.lower() == ".gz"
    if suffix == "npy" and not compressed:
        pieces = _npy_pieces(path)
    elif READERS[suffix] is read_text and not compressed:
        pieces = _text_pieces(path)
    else:
        pieces = _array_pieces(read_cloud(path)[0].points)
    first = 0
    for piece in pieces:
        if not (finite := np.isfinite(piece.points).all(axis=1)).all():
            row = int(np.argmin(finite))
            raise InputError(
                f"{path}: point {first + row + 1} is {piece.points[row].tolist()}; give finite coordinates"
            )
        first += len(piece.points)
        yield piece
    if first == 0:
        raise InputError(f"{path} holds no points; export it again")


def _array_pieces(points: Float[ndarray, "n 3"]) -> Iterator[Piece]:
    for start in range(0, len(points), PIECE):
        yield Piece(points[start : start + PIECE], min(start + PIECE, len(points)) / len(points))


def _npy_pieces(path: Path) -> Iterator[Piece]:
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except Exception as error:  # numpy evaluates the header, which may fail in any way
        raise InputError(f"{path} is pickled, truncated, damaged or no .npy: save numbers by numpy.save") from error
    named = set(AXES) <= set(array.dtype.names or ())
    if not named and (array.ndim != 2 or array.shape[1] < 3 or array.dtype.kind not in "fiu"):
        raise InputError(f"{path} has shape {array.shape} of {array.dtype}: give numbers in shape (n, 3)")
    rows = array.reshape(-1) if named else array
    for start in range(0, len(rows), PIECE):
        part = rows[start : start + PIECE]
        points = np.stack([part[axis] for axis in AXES], axis=1) if named else part[:, :3]
        yield Piece(points.astype(np.float64), min(start + PIECE, len(rows)) / len(rows))


def _text_pieces(path: Path) -> Iterator[Piece]:
    size, line, columns = path.stat().st_size, 1, None
    with path.open("rb") as file:
        rest = b""
        while block := file.read(BLOCK):
            whole, newline, rest = (rest + block).rpartition(b"\n") if file.tell() < size else (rest + block, b"", b"")
            if not (whole or newline):
                continue  # within a line that is longer than a block
            text = decode(path, whole + newline)
            start = 0
            if columns is None:
                start, names = find_rows(path, text)
                columns = _columns(names)
            if text[start:].strip():
                table = parse_rows(path, text[start:], first_line=line + text.count("\n", 0, start))
                if table.shape[1] <= max(columns):
                    raise InputError(f"{path} has {table.shape[1]} numbers in each line: x, y and z are needed")
                yield Piece(table[:, columns], file.tell() / size)
            line += text.count("\n")


def _columns(names: list[str] | None) -> list[int]:
    """Indices of x, y and z among the names of the columns."""
    small = [name.lower() for name in names or AXES]
    return [small.index(axis) for axis in AXES]
