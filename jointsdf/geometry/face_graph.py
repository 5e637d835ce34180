"""Dual graph of a mesh (faces that share an edge), and the smooth regions between its creases."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.geometry.topology import components
from jointsdf.values import UNLABELLED, LabelledMesh

CREASE = np.radians(32.0)  # a cylinder of twelve segments (30 degrees) stays one region


@dataclass(frozen=True)
class FaceGraph:
    """Pairs of faces that share an edge; where more than two do, those that traverse it in opposite directions.

    Attributes:
        pairs: The two faces.
        lengths: Of the shared edge, mesh units.
        angles: Between the two normals, radians; positive where the edge is convex.
        num_faces: Of the mesh.
    """

    pairs: Int[ndarray, "p 2"]
    lengths: Float[ndarray, " p"]
    angles: Float[ndarray, " p"]
    num_faces: int


def face_graph(mesh: LabelledMesh) -> FaceGraph:
    """Find the faces that share an edge, with its dihedral angle, on any mesh: open, non-manifold, of any winding.

    Args:
        mesh: Any frame, no degenerate face.
    """
    ends = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    opposite = mesh.faces[:, [2, 0, 1]].reshape(-1)
    first, second = pair_sides(ends, len(mesh.vertices))
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    one, other = normals[first // 3], normals[second // 3]
    same_way = ends[first, 0] == ends[second, 0]
    other = np.where(same_way[:, None], -other, other)
    start, end = mesh.vertices[ends[first]].swapaxes(0, 1)
    size = np.arctan2(np.linalg.norm(np.cross(one, other), axis=1), np.einsum("pd,pd->p", one, other))
    above = np.einsum("pd,pd->p", one, mesh.vertices[opposite[second]] - start)
    pairs = np.stack([first // 3, second // 3], axis=1)
    lengths = np.linalg.norm(end - start, axis=1)
    return FaceGraph(pairs, lengths, np.where(above > 0, -size, size), len(mesh.faces))


def smooth_regions(graph: FaceGraph, patches: Int[ndarray, " f"] | None) -> Int[ndarray, " f"]:
    """Region of each face: connected faces of one patch; where no patch is known, of dihedral angles below `CREASE`.

    Args:
        graph: Of the mesh.
        patches: Patch id of each face, -1 where unknown.
    """
    known = np.full(graph.num_faces, UNLABELLED) if patches is None else patches
    one, other = known[graph.pairs].T
    joined = (one == other) & ((one != UNLABELLED) | (np.abs(graph.angles) < CREASE))
    return components(graph.pairs[joined], graph.num_faces)


def pair_sides(ends: Int[ndarray, "h 2"], num_vertices: int) -> tuple[Int[ndarray, " p"], Int[ndarray, " p"]]:
    """Pair the sides of faces that are one edge, in opposite directions unless there are only these two.

    Args:
        ends: Vertices of the sides, in the order of their faces.
        num_vertices: Of the mesh.

    Returns:
        The first and the second side of each pair. A side without a neighbour is in none.
    """
    edge = ends.min(axis=1) * num_vertices + ends.max(axis=1)
    order = np.argsort(edge, kind="stable")
    _, number, uses = np.unique(edge, return_inverse=True, return_counts=True)
    edge, found, offset = edge[order], [np.zeros((2, 0), dtype=np.int64)], 1
    while (same := np.flatnonzero(edge[offset:] == edge[:-offset])).size:
        found.append(np.stack([order[same], order[same + offset]]))
        offset += 1
    first, second = np.concatenate(found, axis=1)
    legal = (uses[number[first]] == 2) | (ends[first, 0] != ends[second, 0])
    return first[legal], second[legal]
