"""Normals, areas, edges and used vertices of triangle meshes."""

import igl
import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from jointsdf.values import UNLABELLED, LabelledMesh


def unit(vectors: Float[ndarray, "*n 3"]) -> Float[ndarray, "*n 3"]:
    """Vectors of length 1, or 0."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), np.finfo(float).tiny)


def face_normals(vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]) -> Float[ndarray, "f 3"]:
    """Unit normal of each face, by its winding; zero for a degenerate face.

    >>> face_normals(np.array([[0.0, 0, 0], [2, 0, 0], [0, 3, 0]]), np.array([[0, 1, 2], [0, 2, 1]]))
    array([[ 0.,  0.,  1.],
           [ 0.,  0., -1.]])
    """
    a, b, c = vertices[faces.T]
    return unit(np.cross(b - a, c - a))


def face_areas(mesh: LabelledMesh) -> Float[ndarray, " f"]:
    """Area of each face, mesh units squared."""
    vertices, faces = mesh.vertices.astype(np.float64), mesh.faces.astype(np.int64)
    return np.asarray(igl.doublearea(np.ascontiguousarray(vertices), np.ascontiguousarray(faces)) / 2)


def part_areas(mesh: LabelledMesh) -> Float[ndarray, " k"]:
    """Area of each part, in the order of `mesh.part_ids`, mesh units squared."""
    labelled = mesh.labels != UNLABELLED
    parts = np.searchsorted(mesh.part_ids, mesh.labels[labelled])
    areas = np.bincount(parts, face_areas(mesh)[labelled], minlength=len(mesh.part_ids))
    return areas.astype(np.float64)  # without parts they are whole numbers


def used_vertices(faces: Int[ndarray, "f 3"], count: int) -> tuple[Bool[ndarray, " v"], Int[ndarray, "f 3"]]:
    """Mark the vertices that faces use, and number the faces' corners among these alone.

    >>> used_vertices(np.array([[0, 3, 1]]), 5)
    (array([ True,  True, False,  True, False]), array([[0, 2, 1]]))
    """
    used = np.zeros(count, dtype=bool)
    used[faces] = True
    return used, (np.cumsum(used) - 1)[faces]


def half_longest_side(mesh: LabelledMesh) -> float:
    """Half the longest side of the bounding box of the faces, mesh units."""
    return float(np.ptp(mesh.vertices[mesh.faces].reshape(-1, 3), axis=0).max()) / 2


def relative_area(mesh: LabelledMesh) -> float:
    """Surface area of a mesh in squares of half its longest side: 24 for a cube."""
    return float(face_areas(mesh).sum() / half_longest_side(mesh) ** 2)


def edge_keys(faces: Int[ndarray, "f 3"], vertices: int) -> Int[ndarray, " e"]:
    """One number per edge of each face, the same for every face at that edge: lower vertex * vertices + higher vertex.

    Args:
        faces: Vertex indices, 64 bits.
        vertices: Number of vertices.

    >>> edge_keys(np.array([[0, 1, 2], [2, 1, 3]]), 4)
    array([ 1,  6,  2,  6,  7, 11])
    """
    following = np.roll(faces, -1, axis=1)
    return np.minimum(faces, following).reshape(-1) * vertices + np.maximum(faces, following).reshape(-1)


def edge_uses(faces: Int[ndarray, "f 3"]) -> Int[ndarray, " e"]:
    """Number of faces at each edge.

    Args:
        faces: Vertex indices, 64 bits.

    >>> edge_uses(np.array([[0, 1, 2], [2, 1, 3]])).tolist()
    [1, 1, 2, 1, 1]
    """
    return np.unique(edge_keys(faces, int(faces.max(initial=-1)) + 1), return_counts=True)[1]


def border_edges(mesh: LabelledMesh) -> Int[ndarray, "e 2"]:
    """Vertex pairs of the edges whose faces differ in label, each once; unlabelled faces are ignored.

    >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> border_edges(LabelledMesh(square, np.array([[0, 1, 2], [0, 2, 3]]), np.array([4, 9])))
    array([[0, 2]])
    """
    labelled = mesh.labels != UNLABELLED
    faces, labels = mesh.faces[labelled].astype(np.int64), mesh.labels[labelled]
    count, parts = len(mesh.vertices), max(len(mesh.part_ids), 1)
    last_label = np.zeros(count, dtype=labels.dtype)  # that one of a vertex's faces has
    last_label[faces] = labels[:, None]
    mixed = np.zeros(count, dtype=bool)  # vertices with faces of two labels: a border runs between two of them
    mixed[faces[last_label[faces] != labels[:, None]]] = True
    near = mixed[faces].sum(axis=1) > 1
    classes = np.repeat(np.searchsorted(mesh.part_ids, labels[near]), 3)
    codes = np.sort(edge_keys(faces[near], count) * parts + classes)
    keys = codes // parts
    differs = (keys[1:] == keys[:-1]) & (codes[1:] != codes[:-1])
    return np.stack(np.divmod(np.unique(keys[1:][differs]), count), axis=1)
