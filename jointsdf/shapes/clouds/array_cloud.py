"""Point clouds in numpy's files: npy with an array of rows, npz with arrays by name. Never unpickled."""

import io
import zipfile
import zlib
from pathlib import Path

import numpy as np
from jaxtyping import Shaped
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.shapes.clouds.file_cloud import FileCloud, cloud_of_columns

POINTS = ("points", "xyz", "positions", "vertices", "pos")
TRIPLES = {"normals": ("nx", "ny", "nz"), "normal": ("nx", "ny", "nz")} | dict.fromkeys(
    ("colors", "colours", "color", "rgb"), ("red", "green", "blue")
)


def read_npy(path: Path, data: bytes) -> FileCloud:
    """Read an array of shape (n, 3): points; (n, 6): with normals; (n, 4 or 7): with a label last; or one with fields.

    Args:
        path: Names the file in messages.
        data: The file's content.

    Raises:
        InputError: It is no such array.
    """
    array = _parse(str(path), data)
    if array.dtype.names:
        return cloud_of_columns(str(path), {name: array[name].reshape(-1) for name in array.dtype.names})
    names = {3: (), 4: ("label",), 6: TRIPLES["normals"], 7: (*TRIPLES["normals"], "label")}
    if array.ndim != 2 or array.shape[1] not in names or array.dtype.kind not in "fiu":
        raise InputError(
            f"{path} has shape {array.shape} of {array.dtype}: give numbers in shape (n, 3), (n, 6) with normals, or "
            "with a label last; or an .npz with points, normals, labels"
        )
    return cloud_of_columns(str(path), dict(zip(("x", "y", "z", *names[array.shape[1]]), array.T, strict=True)))


def read_npz(path: Path, data: bytes) -> FileCloud:
    """Read arrays by name: `points`, and where they are there `normals`, `colors`, `labels` and any other column.

    Args:
        path: Names the file in messages.
        data: The file's content.

    Raises:
        InputError: It is no archive of arrays, holds no points, or arrays of other lengths.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            names = [name.removesuffix(".npy") for name in archive.namelist() if name.endswith(".npy")]
            arrays = {name: _parse(f"{path}: its array {name}", archive.read(f"{name}.npy")) for name in names}
    except (zipfile.BadZipFile, EOFError, OSError, NotImplementedError, RuntimeError, zlib.error) as error:
        raise InputError(f"{path} is no .npz, or damaged: save arrays by numpy.savez") from error
    given = next((name for name in POINTS if name in arrays), None)
    if given is None or arrays[given].ndim != 2 or arrays[given].shape[1] != 3 or arrays[given].dtype.kind not in "fiu":
        listed = ", ".join(f"{name} {array.shape}" for name, array in arrays.items()) or "nothing"
        raise InputError(f"{path} holds {listed}: an array `points` of shape (n, 3) is needed")
    columns = dict(zip("xyz", arrays.pop(given).T, strict=True))
    for name, array in arrays.items():
        if len(array := array.reshape(len(array), -1) if array.ndim else array.reshape(1, 1)) != len(columns["x"]):
            raise InputError(f"{path}: {name} has {len(array)} rows for {len(columns['x'])} points: save them again")
        triple = TRIPLES.get(name, ()) if array.shape[1] == 3 else ()
        if triple or array.shape[1] == 1:
            columns |= dict(zip(triple or (name,), array.T, strict=True))
    return cloud_of_columns(str(path), columns)


def _parse(source: str, data: bytes) -> Shaped[ndarray, "..."]:
    try:
        array: ndarray = np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)
        return array
    except Exception as error:  # numpy evaluates the header, which may fail in any way
        what = "pickled, and no pickle is read" if "pickle" in str(error) else "truncated, damaged or no .npy"
        raise InputError(f"{source} is {what}: save an array of numbers by numpy.save") from error
