"""Arrays in `.npy` and `.npz` files, never unpickled."""

import io
import zipfile
import zlib
from pathlib import Path

import numpy as np
from jaxtyping import Shaped
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.shapes.labels.contents import describe_content
from jointsdf.shapes.readers.content import unpack

NAMED = "labels"  # the array of several in an `.npz` that is taken
BY_CONTENT = {"text": "name it .txt or .csv", "a zip archive (.npz?)": "name it .npz"}
SAVE = "save an integer array by numpy.save"


def read_array(path: Path) -> Shaped[ndarray, "..."]:
    """Read the array in a `.npy` file.

    Raises:
        InputError: The file cannot be opened, or is empty, truncated, pickled or no `.npy`; it says what it is instead.
    """
    return _parse_array(f"labels file {path}", read_bytes(path))


def read_archive(path: Path) -> Shaped[ndarray, "..."]:
    """Read an `.npz` file: its only array, or the one named `labels`.

    Raises:
        InputError: The file cannot be opened, is damaged or no `.npz`, or holds several arrays of other names.
    """
    data = read_bytes(path)
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            names = [name.removesuffix(".npy") for name in archive.namelist() if name.endswith(".npy")]
            if len(names) != 1 and NAMED not in names:
                listed = ", ".join(names[:20]) or "none"
                raise InputError(f"labels file {path} holds the arrays {listed}: name one of them {NAMED}")
            name = NAMED if NAMED in names else names[0]
            return _parse_array(f"labels file {path}: its array {name}", archive.read(f"{name}.npy"))
    except InputError:
        raise
    except (zipfile.BadZipFile, EOFError, OSError, ValueError, NotImplementedError, RuntimeError, zlib.error) as error:
        found = describe_content(data)
        what = "truncated or damaged" if found.startswith("a zip") else f"{found}, no .npz"
        raise InputError(f"labels file {path} is {what}: save an integer array by numpy.savez") from error


def flatten_column(source: str, array: Shaped[ndarray, "..."]) -> Shaped[ndarray, " n"]:
    """Flatten an array of one row or one column.

    Raises:
        InputError: It is neither.
    """
    if array.ndim != 1 and not (array.ndim == 2 and 1 in array.shape):
        raise InputError(f"{source} has shape {array.shape}: it must be one integer per face, (faces,)")
    return array.reshape(-1)


def read_bytes(path: Path) -> bytes:
    """Read a file, decompressed where its name ends in `.gz`.

    Raises:
        InputError: It cannot be opened, or is compressed and damaged.
    """
    try:
        return unpack(path, path.read_bytes())
    except OSError as error:
        raise InputError(f"labels file {path} cannot be opened: {error.strerror or error}") from error


def _parse_array(source: str, data: bytes) -> Shaped[ndarray, "..."]:
    try:
        array: ndarray = np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)
        return array
    except Exception as error:  # numpy evaluates the header, which may fail in any way
        found = describe_content(data)
        if found == "a .npy array":
            what = "pickled, and no pickle is read" if "pickle" in str(error) else "truncated or damaged"
            raise InputError(f"{source} is {what}: {SAVE}") from error
        what = "empty" if found == "empty" else f"{found}, no .npy"
        raise InputError(f"{source} is {what}: {BY_CONTENT.get(found, SAVE)}") from error
