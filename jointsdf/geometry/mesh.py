"""A triangle mesh as a surface: points on it, its normals, points near the borders of its parts, what rays meet."""

import igl
import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from numpy.random import Generator

from jointsdf.values import UNLABELLED, LabelledMesh

BORDER_SCALES = (-3.3, -1.3)  # log10 of the narrowest and widest noise about a border, of half the longest side


def area_uniform(
    vertices: Float[ndarray, "v 3"],
    faces: Int[ndarray, "f 3"],
    areas: Float[ndarray, " f"],
    count: int,
    generator: Generator,
) -> tuple[Float[ndarray, "n 3"], Int[ndarray, " n"]]:
    """Points uniform by area on a triangle mesh, in its own frame, and the face of each; the areas up to a factor."""
    chosen = _weighted(areas, count, generator)
    s, t = generator.random((2, count, 1))
    s, t = np.where(s + t > 1, 1 - s, s), np.where(s + t > 1, 1 - t, t)
    a, b, c = vertices[faces[chosen].T].astype(np.float64)
    return a + s * (b - a) + t * (c - a), chosen


def face_normals(vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]) -> Float[ndarray, "f 3"]:
    """Unit normal of each face, by its winding; zero for a degenerate face."""
    a, b, c = vertices[faces.T]
    normals = np.cross(b - a, c - a)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)


def face_areas(mesh: LabelledMesh) -> Float[ndarray, " f"]:
    """Area of each face, mesh units squared."""
    vertices, faces = mesh.vertices.astype(np.float64), mesh.faces.astype(np.int64)
    return np.asarray(igl.doublearea(np.ascontiguousarray(vertices), np.ascontiguousarray(faces)) / 2)


def relative_area(mesh: LabelledMesh) -> float:
    """Surface area of a mesh in squares of half its longest side: 24 for a cube."""
    return float(face_areas(mesh).sum() / _half_side(mesh) ** 2)


def edge_keys(faces: Int[ndarray, "f 3"], vertices: int) -> Int[ndarray, " e"]:
    """One number per edge of each face, the same for every face at that edge: lower vertex * vertices + higher vertex.

    Args:
        faces: Vertex indices, 64 bits.
        vertices: How many vertices there are.
    """
    lower, higher = edge_ends(faces)
    return lower * vertices + higher


def edge_ends(faces: Int[ndarray, "f 3"]) -> tuple[Int[ndarray, " e"], Int[ndarray, " e"]]:
    """The lower and the higher vertex of each edge of each face, the edges of a face one after the other."""
    following = np.roll(faces, -1, axis=1)
    return np.minimum(faces, following).reshape(-1), np.maximum(faces, following).reshape(-1)


def border_edges(mesh: LabelledMesh) -> Int[ndarray, "e 2"]:
    """Vertex pairs of the edges whose faces differ in label, each once; unlabelled faces are ignored."""
    labelled = mesh.labels != UNLABELLED
    faces, labels = mesh.faces[labelled].astype(np.int64), mesh.labels[labelled]
    count, parts = len(mesh.vertices), max(len(mesh.part_ids), 1)
    met = np.zeros(count, dtype=labels.dtype)
    met[faces] = labels[:, None]
    mixed = np.zeros(count, dtype=bool)  # vertices with faces of two labels: a border runs between two of them
    mixed[faces[met[faces] != labels[:, None]]] = True
    near = mixed[faces].sum(axis=1) > 1
    classes = np.repeat(np.searchsorted(mesh.part_ids, labels[near]), 3)
    codes = np.sort(edge_keys(faces[near], count) * parts + classes)
    keys = codes // parts
    differs = (keys[1:] == keys[:-1]) & (codes[1:] != codes[:-1])
    return np.stack(np.divmod(np.unique(keys[1:][differs]), count), axis=1)


def near_borders(
    mesh: LabelledMesh, count: int, generator: Generator
) -> tuple[Float[ndarray, "n 3"], Int[ndarray, " n"]]:
    """Points of the surface near the borders between its parts, and the face of each; none where there is no border.

    Points uniform along the borders are moved by Gaussian noise, its width drawn log-uniform so that every distance
    from the border is met, and taken back to the surface.

    Args:
        mesh: Any frame; the points are in the same.
        count: Number of points.
        generator: Of the draw.
    """
    edges = border_edges(mesh)
    if len(edges) == 0:
        return np.zeros((0, 3)), np.zeros(0, dtype=np.int64)
    start, end = mesh.vertices[edges.T].astype(np.float64)
    chosen = _weighted(np.linalg.norm(end - start, axis=1), count, generator)
    along = start[chosen] + generator.random((count, 1)) * (end - start)[chosen]
    widths = _half_side(mesh) * 10 ** generator.uniform(*BORDER_SCALES, (count, 1))
    moved = along + widths * generator.standard_normal((count, 3))
    vertices, faces = mesh.vertices.astype(np.float64), mesh.faces.astype(np.int64)
    _, nearest, points = igl.point_mesh_squared_distance(
        moved, np.ascontiguousarray(vertices), np.ascontiguousarray(faces)
    )
    return points, nearest.astype(np.int64)


def _weighted(weights: Float[ndarray, " w"], count: int, generator: Generator) -> Int[ndarray, " n"]:
    """Indices drawn in proportion to the weights."""
    cumulative = np.cumsum(weights)
    chosen = np.searchsorted(cumulative, generator.random(count) * cumulative[-1], side="right")
    return np.minimum(chosen, len(weights) - 1)


def _half_side(mesh: LabelledMesh) -> float:
    """Half the longest side of the faces' box."""
    return float(np.ptp(mesh.vertices[mesh.faces].reshape(-1, 3), axis=0).max()) / 2
