"""Tables written row by row into csv, npy, npz and ply files, which are there only when they are whole."""

import io
import zipfile
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
from jaxtyping import Shaped
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.geometry.ply import TYPES
from jointsdf.runs.files import make_folder, replacing

DIGITS = 20  # of a number of rows that is not known yet


class Rows(ABC):
    """A file in progress."""

    @abstractmethod
    def write(self, table: Shaped[ndarray, " n"]) -> None:
        """Append rows."""

    def finish(self) -> None:  # noqa: B027 (most need nothing)
        """Write what is known at the end alone."""


class _Csv(Rows):
    def __init__(self, path: Path, kind: np.dtype, names: Sequence[str]) -> None:  # noqa: ARG002
        self.path, self.names = path, names
        path.write_text(",".join(names) + "\n", encoding="utf-8")

    def write(self, table: Shaped[ndarray, " n"]) -> None:
        flat = pd.DataFrame(dict(zip(self.names, _flatten(table), strict=True)))
        flat.to_csv(self.path, mode="a", header=False, index=False, lineterminator="\n")


class _Npy(Rows):
    """An array; its header is written again when the number of its rows is known, which numpy leaves room for."""

    def __init__(self, path: Path, kind: np.dtype, shape: tuple[int, ...] = ()) -> None:
        self.path, self.kind, self.shape, self.count = path, kind, shape, 0
        self.size = len(header := self._header())
        path.write_bytes(header)

    def write(self, table: Shaped[ndarray, "n ..."]) -> None:
        self.count += len(table)
        with self.path.open("ab") as file:
            file.write(np.ascontiguousarray(table).tobytes())

    def finish(self) -> None:
        header = self._header()
        assert len(header) == self.size, "no room for the number of rows"
        with self.path.open("rb+") as file:
            file.write(header)

    def _header(self) -> bytes:
        written = io.BytesIO()
        kind = np.lib.format.dtype_to_descr(self.kind)
        described = {"descr": kind, "fortran_order": False, "shape": (self.count, *self.shape)}
        np.lib.format.write_array_header_2_0(written, described)
        return written.getvalue()


class _Npz(Rows):
    """An archive of an array per column, each of which is written to a file of its own first."""

    def __init__(self, path: Path, kind: np.dtype, folder: Path) -> None:
        self.path, self.folder = path, folder
        fields = ((name, kind[name].base, kind[name].shape) for name in kind.names or ())
        self.columns = {name: _Npy(folder / f"{name}.npy", base, shape) for name, base, shape in fields}

    def write(self, table: Shaped[ndarray, " n"]) -> None:
        for name, column in self.columns.items():
            column.write(table[name])

    def finish(self) -> None:
        with zipfile.ZipFile(self.path, "w", zipfile.ZIP_STORED, allowZip64=True) as archive:
            for name, column in self.columns.items():
                column.finish()
                archive.write(column.path, f"{name}.npy")


class _Ply(Rows):
    """Vertices with a property per number; the header has a comment in place of the digits that their number lacks."""

    def __init__(self, path: Path, kind: np.dtype, names: Sequence[str]) -> None:
        self.path, self.count = path, 0
        bases = [kind[name].base.str.lstrip("<") for name in kind.names or () for _ in range(_width(kind[name]))]
        self.properties = [f"property {TYPES[base]} {name}" for base, name in zip(bases, names, strict=True)]
        path.write_bytes(self._header())

    def write(self, table: Shaped[ndarray, " n"]) -> None:
        self.count += len(table)
        with self.path.open("ab") as file:
            file.write(table.tobytes())

    def finish(self) -> None:
        with self.path.open("rb+") as file:
            file.write(self._header())

    def _header(self) -> bytes:
        filler = "." * (DIGITS - len(str(self.count)))
        start = ["ply", "format binary_little_endian 1.0", f"comment {filler}", f"element vertex {self.count}"]
        return "\n".join([*start, *self.properties, "end_header\n"]).encode()


FORMATS = ("csv", "npy", "npz", "ply")


@contextmanager
def open_answers(path: Path, kind: np.dtype, names: Sequence[str]) -> Iterator[Rows]:
    """Open a file for the rows of a table; it has its name only after the block has succeeded.

    Args:
        path: Ends in csv, npy, npz or ply.
        kind: Of the table: packed fields of little-endian numbers.
        names: Of each number of a row, for csv and ply.

    Raises:
        InputError: Another ending.
    """
    suffix = path.suffix.lower().lstrip(".")
    if suffix not in FORMATS:
        raise InputError(f"--out {path}: give a name that ends in {', '.join(FORMATS)}")
    with ExitStack() as stack:
        temporary = stack.enter_context(replacing(path))
        if suffix == "npz":
            make_folder(path.parent)
            folder = Path(stack.enter_context(TemporaryDirectory(prefix=f".{path.name}.", dir=path.parent)))
            rows: Rows = _Npz(temporary, kind, folder)
        elif suffix == "npy":
            rows = _Npy(temporary, kind)
        else:
            rows = {"csv": _Csv, "ply": _Ply}[suffix](temporary, kind, names)
        yield rows
        rows.finish()


def _width(kind: np.dtype) -> int:
    """Numbers of a field."""
    return int(np.prod(kind.shape, dtype=int))


def _flatten(table: Shaped[ndarray, " n"]) -> Iterator[Shaped[ndarray, " n"]]:
    """A column for each number of a row."""
    for name in table.dtype.names or ():
        yield from table[name].reshape(len(table), -1).T
