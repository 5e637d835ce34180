"""Parts that PartField found: read from its output folder, or from a run of the user's own checkout.

Source: Liu et al., "PartField: Learning 3D Feature Fields for Part Segmentation and Beyond", ICCV 2025.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import minimum_spanning_tree
from scipy.spatial import KDTree

from jointsdf.errors import InputError
from jointsdf.geometry.topology import components
from jointsdf.shapes.labels.face_matching import match_faces
from jointsdf.shapes.labels.files import read_array
from jointsdf.shapes.readers import mesh_file as file

MOST = 18  # parts, where none are asked for
HOW = (
    "give partfield_dir=<PartField's output folder>, or let your own checkout (github.com/nv-tlabs/PartField, with a "
    "CUDA GPU and its weights) make it: "
    "python -m jointsdf.shapes.labels partfield --repo <checkout> --checkpoint <weights> <mesh>"
)


@dataclass(frozen=True)
class Output:
    """What PartField's folder holds for one mesh.

    Attributes:
        mesh: The mesh whose face order its arrays follow; None where only arrays were kept.
        clusters: Files of labels, by the number of parts.
        features: File of one vector per face, if it was kept.
    """

    mesh: Path | None
    clusters: dict[int, Path]
    features: Path | None


def labels(
    folder: Path | None, names: Sequence[str], corners: Float[ndarray, "f 3 3"], num_parts: int | None
) -> tuple[Int[ndarray, " f"], int]:
    """PartField's part of each face, 0, 1, .. in the order of its ids, and the number of parts asked of it.

    Args:
        folder: PartField's output, searched with its subfolders; None where the user gave none.
        names: What PartField may have called the mesh: its file name up to the first dot.
        corners: Of the mesh's faces, file frame.
        num_parts: Wanted number of parts. None for the most that its clustering offers up to 18, or 18.

    Raises:
        InputError: No folder, nothing for this mesh in it, another mesh, damaged files, or no way to that many parts.
    """
    output = find(folder, names)
    order = np.arange(len(corners))
    if output.mesh is not None:
        theirs = file.read(output.mesh)
        order = match_faces(str(output.mesh), theirs.vertices[theirs.faces], corners)
    wanted = num_parts if num_parts is not None else _usual(output.clusters)
    if wanted in output.clusters:
        ids = _clusters(output.clusters[wanted], len(corners))[order]
        return np.unique(ids, return_inverse=True)[1].reshape(-1).astype(np.int64), wanted
    if output.features is None:
        offered = ", ".join(map(str, sorted(output.clusters)))
        raise InputError(
            f"num_parts={wanted}: {folder} has no features to cut, only {offered} parts; give one of these"
        )
    if wanted > len(corners):
        raise InputError(f"num_parts={wanted}: the mesh has {len(corners)} faces; give a smaller number")
    return cut(_features(output.features, len(corners))[order], corners, wanted), wanted


def names(path: Path, sha256: str) -> tuple[str, ...]:
    """What PartField may call a mesh: its file name up to the first dot, and the name that a run of ours gives it.

    Args:
        path: The mesh file.
        sha256: Of its bytes.
    """
    stem = path.name.partition(".")[0]
    return stem, f"{re.sub(r'[^A-Za-z0-9]', '-', stem)}-{sha256[:6]}"  # without _, which separates PartField's fields


def find(folder: Path | None, names: Sequence[str]) -> Output:
    """PartField's files for a mesh; of several, the first in the order of names, views and paths.

    Raises:
        InputError: No folder, or nothing in it for this mesh.
    """
    if folder is None:
        raise InputError(f"labels=partfield needs PartField's output: {HOW}")
    if not folder.is_dir():
        raise InputError(f"partfield_dir={folder} is no folder: {HOW}")
    arrays, meshes = sorted(folder.rglob("*.npy")), sorted(folder.rglob("input_*.ply"))
    for name in map(re.escape, names):
        features = _first(arrays, rf"part_feat_{name}_(\d+)(_batch)?\.npy")
        clusters: dict[int, Path] = {}
        for path in arrays:
            named = re.fullmatch(rf"{name}_(\d+)_(\d+)\.npy", path.name)
            if named and path.parent.name == "cluster_out":
                clusters.setdefault(int(named[2]), path)
        if features or clusters:
            return Output(_first(meshes, rf"input_{name}_(\d+)\.ply"), clusters, features)
    raise InputError(f"partfield_dir={folder} has nothing for {' or '.join(names)}: {HOW}")


def cut(features: Float[ndarray, "f d"], corners: Float[ndarray, "f 3 3"], num_parts: int) -> Int[ndarray, " f"]:
    """Cut faces into connected parts of like features: Ward's clustering of unit vectors on the graph of faces.

    Pieces that do not touch are joined by bridges between their nearest faces, so that they can share a part.

    Args:
        features: One vector per face.
        corners: Of the faces, any frame.
        num_parts: From 1 to the number of faces.

    Raises:
        InputError: scikit-learn is not installed.
    """
    try:
        from sklearn.cluster import AgglomerativeClustering
    except ImportError as error:
        raise InputError("cutting PartField's features needs scikit-learn: pip install '.[labels]'") from error
    unit = features / np.maximum(np.linalg.norm(features, axis=1, keepdims=True), np.finfo(float).tiny)
    pairs = _neighbours(corners)
    pairs = np.concatenate([pairs, _bridges(corners.mean(axis=1), components(pairs, len(corners)))])
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(corners),) * 2)
    clustering = AgglomerativeClustering(num_parts, connectivity=(graph + graph.T).tocsr(), linkage="ward")
    return np.asarray(clustering.fit(unit).labels_, dtype=np.int64)


def _first(paths: Sequence[Path], pattern: str) -> Path | None:
    return next((path for path in paths if re.fullmatch(pattern, path.name)), None)


def _usual(clusters: dict[int, Path]) -> int:
    """The number of parts to take where the user asks for none."""
    few = [count for count in clusters if 2 <= count <= MOST]
    return max(few, default=min(clusters, default=MOST))


def _clusters(path: Path, num_faces: int) -> Int[ndarray, " f"]:
    """The ids in a file of labels: of tree nodes as integers, or of k-means in one column of floats."""
    array = read_array(path)
    if array.size != num_faces or array.shape not in ((num_faces,), (num_faces, 1)):
        raise InputError(f"{path} has shape {array.shape}, the mesh has {num_faces} faces: it is of another mesh")
    if array.dtype.kind not in "iuf" or not np.array_equal(array, np.round(array)):
        raise InputError(f"{path} holds no integers: it is no clustering of PartField's")
    return array.reshape(-1).astype(np.int64)


def _features(path: Path, num_faces: int) -> Float[ndarray, "f d"]:
    """The vectors in a file of features."""
    array = read_array(path)
    if array.ndim != 2 or len(array) != num_faces:
        raise InputError(f"{path} has shape {array.shape}, the mesh has {num_faces} faces: it is of another mesh")
    if array.dtype.kind != "f" or not np.isfinite(array).all():
        raise InputError(
            f"{path} holds no features: one vector of finite numbers per face is needed; run PartField again"
        )
    return array.astype(np.float64)


def _neighbours(corners: Float[ndarray, "f 3 3"]) -> Int[ndarray, "p 2"]:
    """Faces that share an edge, by the places of its ends."""
    places = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)[1].reshape(-1, 3)
    edges = np.sort(places[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    order = np.lexsort(edges.T)
    same = (edges[order[1:]] == edges[order[:-1]]).all(axis=1)
    return np.stack([order[:-1][same] // 3, order[1:][same] // 3], axis=1)


def _bridges(centres: Float[ndarray, "f 3"], component: Int[ndarray, " f"]) -> Int[ndarray, "b 2"]:
    """Pairs of faces that join all components: the nearest faces along a shortest tree between their centres."""
    members = np.split(np.argsort(component, kind="stable"), np.cumsum(np.bincount(component))[:-1])
    if len(members) == 1:
        return np.zeros((0, 2), dtype=np.int64)
    middles = np.array([centres[faces].mean(axis=0) for faces in members])
    near = KDTree(middles).query(middles, k=min(8, len(middles)))[1]
    along = np.lexsort(middles.T)  # a chain through all of them: the neighbours alone need not hang together
    first = np.concatenate([np.repeat(np.arange(len(near)), near.shape[1]), along[:-1]])
    second = np.concatenate([near.ravel(), along[1:]])
    first, second = np.unique(np.sort(np.stack([first, second])[:, first != second], axis=0), axis=1)
    lengths = np.linalg.norm(middles[first] - middles[second], axis=1) + 1e-9 * np.ptp(centres)  # a zero is no edge
    tree = minimum_spanning_tree(coo_array((lengths, (first, second)), shape=(len(members),) * 2)).tocoo()
    bridges = []
    for one, other in zip(tree.row, tree.col, strict=True):
        away, index = KDTree(centres[members[one]]).query(centres[members[other]])
        best = int(np.argmin(away))
        bridges.append((members[one][index[best]], members[other][best]))
    return np.array(bridges, dtype=np.int64)
