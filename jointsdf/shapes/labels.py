"""Part labels of a mesh's faces: read from files, merged to few parts, numbered by falling area."""

import io
from collections.abc import Callable
from difflib import get_close_matches
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.values import UNLABELLED, InputError, LabelledMesh


def brep(_: Path, patches: Path) -> tuple[Path, str] | None:
    """The mesh's B-rep patches, as they are."""
    return (patches, "brep") if patches.is_file() else None


def auto(mesh_path: Path, patches: Path) -> tuple[Path, str] | None:
    """`labels.npy` beside the mesh, else its B-rep patches."""
    given = mesh_path.with_name("labels.npy")
    return (given, "file:labels.npy") if given.is_file() else brep(mesh_path, patches)


def none(_: Path, __: Path) -> None:
    """No labels, even where some lie beside the mesh."""


PROVIDERS: dict[str, Callable[[Path, Path], tuple[Path, str] | None]] = {"auto": auto, "brep": brep, "none": none}


def find(labels: str, mesh_path: Path, patches: Path) -> tuple[Path, str] | None:
    """The label file meant by a user's `labels=` value, and the provider's name; None where there is none.

    Args:
        labels: A provider's name or the path of a `.npy` or ABC features file.
        mesh_path: The mesh file; providers look beside it.
        patches: The file that holds the mesh's B-rep patches, if it exists.

    Raises:
        InputError: `labels` is neither a provider nor a path of an existing file.
    """
    if labels in PROVIDERS:
        return PROVIDERS[labels](mesh_path, patches)
    return named_file(labels)


def named_file(labels: str) -> tuple[Path, str]:
    """The label file at a path that the user gave, and the provider's name.

    Raises:
        InputError: There is no such file.
    """
    path = Path(labels).expanduser()
    if path.is_file():
        return path, f"file:{path.name}"
    if path.suffix or len(path.parts) > 1:
        raise InputError(f"labels file not found: {labels}")
    near = get_close_matches(labels, PROVIDERS, n=1, cutoff=0.0)[0]
    raise InputError(f"unknown labels={labels!r}: give a .npy file or one of {', '.join(PROVIDERS)} (near: {near})")


def read(path: Path, num_faces: int) -> Int[ndarray, " f"]:
    """Read one label per face of the mesh file.

    Args:
        path: A `.npy` file of integers >= -1, shape (f,) or (f, 1).
        num_faces: Faces of the mesh FILE, before degenerate ones are dropped.

    Raises:
        InputError: The file is empty, truncated, pickled, not of integers, of another length, or below -1.
    """
    try:
        array = np.lib.format.read_array(io.BytesIO(path.read_bytes()), allow_pickle=False)
    except OSError as error:
        raise InputError(f"labels file {path} cannot be opened: {error.strerror or error}") from error
    except (ValueError, EOFError, MemoryError, SyntaxError) as error:
        raise InputError(
            f"labels file {path} is empty, truncated, pickled or no .npy: save an integer array by numpy.save"
        ) from error
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


def numbered_by_area(mesh: LabelledMesh) -> Int[ndarray, " f"]:
    """Labels 0, 1, .. by falling area of the parts, so that a number means something across shapes; -1 stays."""
    labelled = mesh.labels != UNLABELLED
    parts = np.searchsorted(mesh.part_ids, mesh.labels[labelled])
    part_areas = np.bincount(parts, face_areas(mesh)[labelled], minlength=len(mesh.part_ids))
    labels = mesh.labels.copy()
    labels[labelled] = np.argsort(np.argsort(-part_areas, kind="stable"), kind="stable")[parts]
    return labels


def merged(mesh: LabelledMesh, limit: int) -> Int[ndarray, " f"]:
    """Merge small parts into neighbours until at most `limit` remain, numbered by falling area.

    The smallest part goes to the neighbour with the longest shared border; parts without a neighbour go last,
    each to the part with the nearest centroid.

    Args:
        mesh: Any frame; labels -1 take no part.
        limit: Most parts that may remain, >= 1.
    """
    ids, labelled = mesh.part_ids, mesh.labels != UNLABELLED
    parts = np.searchsorted(ids, mesh.labels[labelled])
    face_area = face_areas(mesh)[labelled]
    centres = mesh.vertices[mesh.faces[labelled]].mean(axis=1)
    area = np.bincount(parts, face_area, minlength=len(ids))
    moment = np.stack([np.bincount(parts, face_area * axis, minlength=len(ids)) for axis in centres.T], axis=1)
    border = border_lengths(mesh)
    owner = np.arange(len(ids))
    alive = np.ones(len(ids), dtype=bool)
    while alive.sum() > limit:
        has_neighbour = border.any(axis=1)
        candidates = np.flatnonzero(has_neighbour if has_neighbour.any() else alive)
        small = int(candidates[np.argmin(area[candidates])])
        alive[small] = False
        into = int(np.argmax(border[small])) if border[small].any() else _nearest(moment, area, small, alive)
        area[into] += area[small]
        moment[into] += moment[small]
        border[into] += border[small]
        border[:, into] += border[:, small]
        border[small] = border[:, small] = border[into, into] = 0.0
        owner[owner == small] = into
    labels = mesh.labels.copy()
    labels[labelled] = ids[owner[parts]]
    return numbered_by_area(LabelledMesh(mesh.vertices, mesh.faces, labels))


def border_lengths(mesh: LabelledMesh) -> Float[ndarray, "k k"]:
    """Length of the border between each two parts (rows and columns in the order of `part_ids`), mesh units.

    Zero on the diagonal. An edge of more than two faces counts between consecutive ones.
    """
    edges = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    labels = np.repeat(mesh.labels, 3)
    order = np.lexsort((labels, edges[:, 1], edges[:, 0]))
    edges, labels = edges[order], labels[order]
    first, second = labels[:-1], labels[1:]
    shared = (edges[:-1] == edges[1:]).all(axis=1) & (first != second) & (first != UNLABELLED) & (second != UNLABELLED)
    ends = mesh.vertices[edges[:-1][shared]]
    num_parts = len(mesh.part_ids)
    lengths = np.zeros((num_parts, num_parts))
    pair = np.searchsorted(mesh.part_ids, first[shared]), np.searchsorted(mesh.part_ids, second[shared])
    np.add.at(lengths, pair, np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1))
    return lengths + lengths.T


def face_areas(mesh: LabelledMesh) -> Float[ndarray, " f"]:
    """Area of each face, mesh units squared."""
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    return np.asarray(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))


def _nearest(moment: Float[ndarray, "k 3"], area: Float[ndarray, " k"], part: int, alive: ndarray) -> int:
    """The living part whose centroid is nearest to that of `part`."""
    centroids = moment / np.maximum(area, np.finfo(float).tiny)[:, None]
    distance = np.linalg.norm(centroids - centroids[part], axis=1)
    return int(np.argmin(np.where(alive, distance, np.inf)))
