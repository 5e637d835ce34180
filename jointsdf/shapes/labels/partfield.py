"""Parts found by PartField, read from its output folder.

Source: Liu et al., "PartField: Learning 3D Feature Fields for Part Segmentation and Beyond", ICCV 2025.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.shapes.labels.array_files import read_array
from jointsdf.shapes.labels.clustering import cluster_features
from jointsdf.shapes.labels.face_matching import match_faces
from jointsdf.shapes.readers.file_mesh import FileMesh
from jointsdf.shapes.readers.mesh_file import read_mesh

MOST = 18  # parts, where the user gives no number
ADVICE = (
    "give partfield_dir=<PartField's output folder>, or let your own checkout (github.com/nv-tlabs/PartField, with a "
    "CUDA GPU and its weights) make it: "
    "python -m jointsdf.shapes.labels partfield --repo <checkout> --checkpoint <weights> <mesh>"
)


@dataclass(frozen=True)
class Output:
    """Files of PartField's output for one mesh.

    Attributes:
        mesh: The mesh whose face order the arrays follow; None where there are only arrays.
        clusters: Files of labels, by the number of parts.
        features: File of one vector per face, if there is one.
    """

    mesh: Path | None
    clusters: dict[int, Path]
    features: Path | None


def read_parts(
    folder: Path | None, names: Sequence[str], mesh: FileMesh, num_parts: int | None
) -> tuple[Int[ndarray, " f"], int]:
    """Read PartField's part of each face, or cluster its features where it has no parts of that number.

    Args:
        folder: PartField's output, searched with its subfolders; None where the user gave none.
        names: Names that PartField may have given to the mesh, see `possible_names`.
        mesh: The mesh in its file.
        num_parts: Wanted number of parts. None for the most that its clustering offers up to 18, or 18.

    Returns:
        The parts, 0, 1, .. in the order of PartField's ids, and the number of parts wanted of it.

    Raises:
        InputError: No folder, nothing for this mesh in it, another mesh, damaged files, or no way to that many parts.
    """
    output = find_output(folder, names)
    corners = mesh.vertices[mesh.faces]
    order = np.arange(len(corners))
    if output.mesh is None and mesh.has_polygons:
        raise InputError(
            f"partfield_dir={folder} has no input_{names[0]}_0.ply, so it is unknown which triangles its parts are of: "
            "the mesh has polygons; triangulate it and run PartField again"
        )
    if output.mesh is not None:
        theirs = read_mesh(output.mesh)
        order = match_faces(str(output.mesh), theirs.vertices[theirs.faces], corners)
    wanted = num_parts if num_parts is not None else _default_count(output.clusters)
    if wanted in output.clusters:
        ids = _read_clusters(output.clusters[wanted], len(corners))[order]
        return np.unique(ids, return_inverse=True)[1].reshape(-1).astype(np.int64), wanted
    if output.features is None:
        offered = ", ".join(map(str, sorted(output.clusters)))
        raise InputError(
            f"num_parts={wanted}: {folder} has no features to cut, only {offered} parts; give one of these"
        )
    if wanted > len(corners):
        raise InputError(f"num_parts={wanted}: the mesh has {len(corners)} faces; give a smaller number")
    return cluster_features(_read_features(output.features, len(corners))[order], corners, wanted), wanted


def possible_names(path: Path, sha256: str) -> tuple[str, ...]:
    """Names that PartField may give to a mesh: its file name up to the first dot, and that of our runs of PartField.

    Args:
        path: The mesh file.
        sha256: Of its bytes.
    """
    stem = path.name.partition(".")[0]
    return stem, f"{re.sub(r'[^A-Za-z0-9]', '-', stem)}-{sha256[:6]}"  # without _, which separates PartField's fields


def find_output(folder: Path | None, names: Sequence[str]) -> Output:
    """Find PartField's files for a mesh; of several, the first in the order of names, views and paths.

    Raises:
        InputError: No folder, or nothing in it for this mesh.
    """
    if folder is None:
        raise InputError(f"labels=partfield needs PartField's output: {ADVICE}")
    if not folder.is_dir():
        raise InputError(f"partfield_dir={folder} is no folder: {ADVICE}")
    arrays, meshes = sorted(folder.rglob("*.npy")), sorted(folder.rglob("input_*.ply"))
    for name in map(re.escape, names):
        features = _find_first(arrays, rf"part_feat_{name}_(\d+)(_batch)?\.npy")
        clusters: dict[int, Path] = {}
        for path in arrays:
            named = re.fullmatch(rf"{name}_(\d+)_(\d+)\.npy", path.name)
            if named and path.parent.name == "cluster_out":
                clusters.setdefault(int(named[2]), path)
        if features or clusters:
            return Output(_find_first(meshes, rf"input_{name}_(\d+)\.ply"), clusters, features)
    raise InputError(f"partfield_dir={folder} has nothing for {' or '.join(names)}: {ADVICE}")


def _find_first(paths: Sequence[Path], pattern: str) -> Path | None:
    return next((path for path in paths if re.fullmatch(pattern, path.name)), None)


def _default_count(clusters: dict[int, Path]) -> int:
    """Number of parts where the user gives none."""
    few = [count for count in clusters if 2 <= count <= MOST]
    return max(few, default=min(clusters, default=MOST))


def _read_clusters(path: Path, num_faces: int) -> Int[ndarray, " f"]:
    """Read the ids in a file of labels: of tree nodes as integers, or of k-means in one column of floats."""
    array = read_array(path)
    if array.size != num_faces or array.shape not in ((num_faces,), (num_faces, 1)):
        raise InputError(f"{path} has shape {array.shape}, the mesh has {num_faces} faces: it is of another mesh")
    if array.dtype.kind not in "iuf" or not np.array_equal(array, np.round(array)):
        raise InputError(f"{path} holds no integers: it is no clustering of PartField's")
    return array.reshape(-1).astype(np.int64)


def _read_features(path: Path, num_faces: int) -> Float[ndarray, "f d"]:
    """Read the vectors in a file of features."""
    array = read_array(path)
    if array.ndim != 2 or len(array) != num_faces:
        raise InputError(f"{path} has shape {array.shape}, the mesh has {num_faces} faces: it is of another mesh")
    if array.dtype.kind != "f" or not np.isfinite(array).all():
        raise InputError(
            f"{path} holds no features: one vector of finite numbers per face is needed; run PartField again"
        )
    return array.astype(np.float64)
