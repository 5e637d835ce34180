"""Part labels, one integer per face: read from `.npy` and text files, renumbered by falling area."""

import io
import re
from pathlib import Path

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.geometry.mesh import face_areas
from jointsdf.values import UNLABELLED, LabelledMesh

TEXT = (".txt",)


def read_labels(path: Path, num_faces: int) -> Int[ndarray, " f"]:
    """Read one label per face of the mesh file.

    Args:
        path: A `.npy` file of integers >= -1, shape (f,) or (f, 1), or a `.txt` file with one of them in each line.
        num_faces: Faces of the mesh FILE, before degenerate ones are dropped.

    Raises:
        InputError: The file is empty, truncated, pickled, not of integers, of another length, or below -1.
    """
    array = _read_text(path) if path.suffix.lower() in TEXT else read_array(path)
    if array.dtype.kind not in "iu":
        raise InputError(f"labels file {path} holds {array.dtype}: save an integer array, one part id >= -1 per face")
    if array.ndim != 1 and array.shape[1:] != (1,):
        raise InputError(f"labels file {path} has shape {array.shape}: it must be one integer per face, ({num_faces},)")
    if len(array) != num_faces:
        raise InputError(f"labels file {path} has {len(array)} labels, the mesh file has {num_faces} faces")
    if array.dtype == np.uint64 and array.size and array.max() > np.iinfo(np.int64).max:
        raise InputError(f"labels file {path} holds {array.max()}: part ids must fit 64-bit signed integers")
    labels = array.reshape(-1).astype(np.int64)
    if labels.size and labels.min() < UNLABELLED:
        raise InputError(f"labels file {path} holds {labels.min()}: part ids are >= -1, and -1 means unlabelled")
    return labels


def read_array(path: Path) -> ndarray:
    """Read the array in a `.npy` file.

    Raises:
        InputError: The file cannot be opened, or is empty, truncated, pickled or no `.npy`.
    """
    try:
        array: ndarray = np.lib.format.read_array(io.BytesIO(path.read_bytes()), allow_pickle=False)
        return array
    except OSError as error:
        raise InputError(f"labels file {path} cannot be opened: {error.strerror or error}") from error
    except (ValueError, EOFError, MemoryError, SyntaxError) as error:
        raise InputError(
            f"labels file {path} is empty, truncated, pickled or no .npy: save an integer array by numpy.save"
        ) from error


def _read_text(path: Path) -> Int[ndarray, " f"]:
    """Read the integers in the lines of a text file; empty lines at its end do not count."""
    try:
        lines = path.read_bytes().decode("utf-8-sig").rstrip().splitlines()
    except OSError as error:
        raise InputError(f"labels file {path} cannot be opened: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"labels file {path} is no text: write one integer per line, one line per face") from error
    if not lines:
        raise InputError(f"labels file {path} is empty: write one integer per line, one line per face")
    for number, line in enumerate(lines, start=1):
        if not re.fullmatch(r"\s*[+-]?[0-9]{1,18}\s*", line):
            raise InputError(
                f"labels file {path} has {line.strip()[:40]!r} in line {number}: write one integer per line"
            )
    return np.array([int(line) for line in lines], dtype=np.int64)


def number_by_area(mesh: LabelledMesh) -> Int[ndarray, " f"]:
    """Renumber the parts 0, 1, .. by falling area, so that a number means something across shapes; -1 stays.

    >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [4, 0, 0]])
    >>> number_by_area(LabelledMesh(square, np.array([[0, 1, 2], [1, 3, 2]]), np.array([5, 7])))
    array([1, 0])
    """
    labelled = mesh.labels != UNLABELLED
    parts = np.searchsorted(mesh.part_ids, mesh.labels[labelled])
    part_areas = np.bincount(parts, face_areas(mesh)[labelled], minlength=len(mesh.part_ids))
    labels = mesh.labels.copy()
    labels[labelled] = np.argsort(np.argsort(-part_areas, kind="stable"), kind="stable")[parts]
    return labels
