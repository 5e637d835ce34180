"""Reader of PCD files, the format of the Point Cloud Library: text, binary and compressed (version 0.7).

Source: the format's description at pointclouds.org. A reader of its own: the library's bindings are not on PyPI, and
Open3D, which reads it, weighs 400 MB.
"""

import logging
import re
from pathlib import Path

import numpy as np
from jaxtyping import Shaped
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.shapes.clouds.file_cloud import AXES, FileCloud, cloud_of_columns
from jointsdf.shapes.clouds.lzf import decompress

KINDS = {"F": "f", "I": "i", "U": "u"}
DATA = re.compile(rb"(?m)^DATA[ \t]+(\w+)[ \t]*\r?\n")
LONGEST = 1 << 16  # bytes of a header
LARGEST = 1 << 32  # bytes of a decompressed table
COLOUR = ("rgb", "rgba")  # one number that holds red, green and blue in its bytes

logger = logging.getLogger(__name__)


def read_pcd(path: Path, data: bytes) -> FileCloud:
    """Read a PCD file; points without a place (NaN, as in organised clouds) are left out.

    Args:
        path: Names the file in messages.
        data: The file's content.

    Raises:
        InputError: It is no PCD file, cut or damaged.
    """
    found = DATA.search(data, 0, LONGEST)
    if not found:
        raise InputError(
            f"{path} cannot be read as pcd (truncated or damaged?): its header has no DATA; export it again"
        )
    entries = {
        words[0]: words[1:] for line in data[: found.start()].decode("latin-1").splitlines() if (words := line.split())
    }
    try:
        kind, rows = _row_type(entries), int(entries["POINTS"][0])
        if rows < 0:
            raise ValueError
    except (KeyError, ValueError, IndexError, TypeError) as error:
        raise InputError(
            f"{path} cannot be read as pcd: its header is incomplete or damaged; export it again"
        ) from error
    body = data[found.end() :]
    try:
        columns = {"ascii": _read_ascii, "binary": _read_binary, "binary_compressed": _read_compressed}[
            found[1].decode().lower()
        ](kind, rows, body)
    except (KeyError, ValueError, IndexError) as error:
        raise InputError(
            f"{path} is truncated or damaged: it does not hold its {rows} points; export it again"
        ) from error
    for name in COLOUR:
        if name in columns and columns[name].dtype.itemsize == 4:
            packed = np.ascontiguousarray(columns.pop(name)).view("<u4")
            columns |= {one: (packed >> shift & 255).astype(np.uint8) for one, shift in (("r", 16), ("g", 8), ("b", 0))}
    cloud = cloud_of_columns(str(path), columns)
    placed = np.isfinite(cloud.points).all(axis=1)
    if not placed.all():
        logger.info("%s: %d of %d points have no place (NaN) and are left out", path, int((~placed).sum()), len(placed))
    return cloud.take(placed)


def _row_type(entries: dict[str, list[str]]) -> np.dtype[np.void]:
    """Numpy's type of a row, of packed fields; padding and fields of several numbers have names of their own."""
    names, sizes, types = entries["FIELDS"], entries["SIZE"], entries["TYPE"]
    counts = entries.get("COUNT", ["1"] * len(names))
    fields = []
    for number, (name, size, kind, count) in enumerate(zip(names, sizes, types, counts, strict=True)):
        shape = (int(count),) if int(count) != 1 else ()
        fields.append((f"_{number}" if name == "_" else name, f"<{KINDS[kind]}{int(size)}", shape))
    if not set(AXES) <= {name.lower() for name in names}:
        raise ValueError
    return np.dtype(fields)


def _read_ascii(kind: np.dtype[np.void], rows: int, body: bytes) -> dict[str, Shaped[ndarray, " n"]]:
    widths = [int(np.prod(kind[name].shape, dtype=int)) for name in kind.names or ()]
    words = body.split()
    if len(words) < rows * sum(widths):
        raise ValueError
    table = np.array(words[: rows * sum(widths)], dtype=object).reshape(rows, sum(widths))
    starts = np.cumsum([0, *widths])
    return {
        name: table[:, start].astype(np.float64).astype(kind[name].base)
        for name, start, width in zip(kind.names or (), starts, widths, strict=False)
        if width == 1
    }


def _read_binary(kind: np.dtype[np.void], rows: int, body: bytes) -> dict[str, Shaped[ndarray, " n"]]:
    table = np.frombuffer(body, kind, rows)
    return {name: table[name] for name in kind.names or () if not kind[name].shape}


def _read_compressed(kind: np.dtype[np.void], rows: int, body: bytes) -> dict[str, Shaped[ndarray, " n"]]:
    """Read columns one after another, compressed as one by LZF."""
    packed, size = (int(number) for number in np.frombuffer(body, "<u4", 2))
    if size != rows * kind.itemsize or size > LARGEST or len(body) < 8 + packed:
        raise ValueError
    flat, columns, at = decompress(body[8 : 8 + packed], size), {}, 0
    for name in kind.names or ():
        if not kind[name].shape:
            columns[name] = np.frombuffer(flat, kind[name], rows, at)
        at += rows * kind[name].itemsize
    return columns
