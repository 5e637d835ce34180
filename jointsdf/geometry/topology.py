"""Connected components, Euler characteristic and volume of triangle meshes, and components of any graph."""

import igl
import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from jointsdf.geometry.caching import cached_by_identity
from jointsdf.geometry.mesh import edge_keys, edge_uses
from jointsdf.values import LabelledMesh


def components(pairs: Int[ndarray, "p 2"], count: int) -> Int[ndarray, " n"]:
    """Connected component of each node of a graph, numbered in the order of their first nodes.

    Args:
        pairs: The two nodes of each edge.
        count: Number of nodes.

    >>> components(np.array([[4, 1], [0, 2]]), 5)
    array([0, 1, 0, 2, 1])
    """
    edges = coo_array((np.ones(len(pairs), dtype=np.int8), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    _, found = connected_components(edges, directed=False)
    _, first, compact = np.unique(found, return_index=True, return_inverse=True)
    numbers: Int[ndarray, " n"] = np.argsort(np.argsort(first))[compact]
    return numbers


def face_components(faces: Int[ndarray, "f 3"]) -> Int[ndarray, " f"]:
    """Connected component of each face, numbered from 0; faces that share a vertex are connected."""
    if len(faces) == 0:
        return np.zeros(0, dtype=np.int64)
    corners = np.unique(faces, return_inverse=True)[1]  # libigl counts a vertex without a face as a component
    of_vertex = igl.vertex_components(corners.reshape(-1, 3).astype(np.int64))
    return np.asarray(of_vertex[corners.reshape(-1, 3)[:, 0]], dtype=np.int64)


def edge_components(faces: Int[ndarray, "f 3"]) -> Int[ndarray, " f"]:
    """Connected component of each face, numbered from 0; faces that share an edge are connected."""
    return np.asarray(igl.facet_components(np.ascontiguousarray(faces, dtype=np.int64))[1], dtype=np.int64)


def count_components(faces: Int[ndarray, "f 3"]) -> int:
    """Number of connected components; faces that share a vertex are connected."""
    return int(face_components(faces).max(initial=-1)) + 1


def count_cavities(vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]) -> int:
    """Number of closed components that are wound inward; faces that share an edge are connected."""
    return int((component_volumes(vertices, faces, edge_components(faces)) < 0).sum())


def component_volumes(
    vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], number: Int[ndarray, " f"]
) -> Float[ndarray, " c"]:
    """Volume of each closed component by the divergence theorem, positive where it winds outward.

    Args:
        vertices: Positions.
        faces: Vertex indices.
        number: Component of each face, from 0.
    """
    a, b, c = (vertices - vertices.mean(axis=0))[faces.T]
    return np.asarray(np.bincount(number, np.einsum("ij,ij->i", a, np.cross(b, c)) / 6))


def component_sizes(
    vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], number: Int[ndarray, " f"]
) -> Float[ndarray, " c"]:
    """Longest side of each component's bounding box; arguments as of `component_volumes`.

    >>> ends = np.array([[0.0, 0, 0], [2, 0, 0], [0, 1, 0], [5, 0, 0], [5, 3, 0], [6, 0, 0]])
    >>> component_sizes(ends, np.array([[0, 1, 2], [3, 4, 5]]), np.array([0, 1]))
    array([2., 3.])
    """
    if not len(faces):
        return np.zeros(0)
    order = np.argsort(number, kind="stable")
    corners = vertices[faces[order]]
    first = np.flatnonzero(np.diff(number[order], prepend=-1))
    low, high = np.minimum.reduceat(corners.min(axis=1), first), np.maximum.reduceat(corners.max(axis=1), first)
    return np.asarray((high - low).max(axis=1))


@cached_by_identity
def pieces(mesh: LabelledMesh) -> Int[ndarray, " f"]:
    """`face_components` of a mesh; cached."""
    return face_components(mesh.faces)


@cached_by_identity
def topology(mesh: LabelledMesh) -> dict[str, float]:
    """Number of `components`, `euler` characteristic and signed `volume` of one mesh; all 0 without faces.

    euler = vertices - edges + faces. Vertices that no face uses do not count.

    Args:
        mesh: Any frame; the volume is in its unit cubed, positive where faces are counter-clockwise from outside.
    """
    if mesh.is_empty:
        return {"components": 0.0, "euler": 0.0, "volume": 0.0}
    used, corners = np.unique(mesh.faces, return_inverse=True)
    faces = corners.reshape(-1, 3)
    edges = len(np.unique(edge_keys(faces, len(used))))
    return {
        "components": float(pieces(mesh).max() + 1),
        "euler": float(len(used) - edges + len(faces)),
        "volume": signed_volume(mesh.vertices[used].astype(np.float64), faces),
    }


def signed_volume(vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]) -> float:
    """Volume that closed faces enclose, by the divergence theorem; positive where they wind outward."""
    a, b, c = (vertices - vertices.mean(axis=0))[faces.T]
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def side_uses(faces: Int[ndarray, "f 3"]) -> Int[ndarray, "f 3"]:
    """Number of faces at each side of each face: the edges from its corners 0, 1 and 2."""
    _, number, uses = np.unique(edge_keys(faces, int(faces.max()) + 1), return_inverse=True, return_counts=True)
    counts: Int[ndarray, "f 3"] = uses[number].reshape(-1, 3)
    return counts


def is_closed(faces: Int[ndarray, "f 3"]) -> bool:
    """True if every edge has exactly two faces."""
    return bool((edge_uses(faces) == 2).all())


def is_consistent(faces: Int[ndarray, "f 3"]) -> bool:
    """True if no edge is traversed twice in one direction, as between faces that disagree about the outside."""
    starts, ends = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    keys = np.sort(starts * (int(faces.max()) + 1) + ends)
    return bool((keys[1:] != keys[:-1]).all())
