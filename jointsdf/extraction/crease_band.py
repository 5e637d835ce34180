"""The band of a marching-cubes mesh around its creases: exact gradients there, and the surfaces on both sides.

A fitted field rounds its creases within about a cell, so the gradient beside one belongs to neither side. Each vertex
of the band therefore takes over the tangent plane of a vertex further away from the crease on its own side, as if the
side went on up to the crease: the one where the normal turns least, whose plane the vertex is near.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from jointsdf.geometry.mesh import edge_keys, unit

Differential = Callable[[Float[ndarray, "n 3"]], tuple[Float[ndarray, " n"], Float[ndarray, "n 3"]]]

BEND = np.radians(8.0)  # between the vertex normals of a face from which the field is asked near it
RINGS = 3  # of vertices around those faces
ROUNDS = 5  # of handing planes on, a ring each
LONGEST_STEP = 0.5  # of a vertex towards the zero level set, cells
FLATTEST = 0.3  # gradient from which Newton's step is trusted
SHORTEST = 0.5  # length over which a turn counts at most, cells
REACH = 3.0  # farthest that a plane is taken from, cells
TURN_COST, OFFSET_COST, DISTANCE_COST = 2.0, 3.0, 0.05  # per radian a cell, per cell squared, and per cell


@dataclass(frozen=True)
class Band:
    """A part of a mesh with the surface that each of its vertices is on.

    Attributes:
        vertices: Index of each vertex of the band in the mesh.
        faces: Index of each face of the band, all of whose vertices are in it.
        corners: Vertices of these faces, as indices into `vertices`.
        points: Positions, on the zero level set.
        normals: Unit normal of the plane of each vertex's side.
        anchors: A point of that plane.
        own_normals: Unit gradient of the field at each vertex.
        rim: Marks the vertices that faces outside the band have.
    """

    vertices: Int[ndarray, " b"]
    faces: Int[ndarray, " f"]
    corners: Int[ndarray, "f 3"]
    points: Float[ndarray, "b 3"]
    normals: Float[ndarray, "b 3"]
    anchors: Float[ndarray, "b 3"]
    own_normals: Float[ndarray, "b 3"]
    rim: Bool[ndarray, " b"]

    @cached_property
    def edges(self) -> Int[ndarray, "e 2"]:
        """Ends of the edges, each once, the lower first, in ascending order."""
        return edges_of(self.corners, len(self.points))

    def with_own_planes(self, chosen: Bool[ndarray, " b"]) -> "Band":
        """The band with some of its vertices on their own tangent planes."""
        normals = np.where(chosen[:, None], self.own_normals, self.normals)
        return replace(self, normals=normals, anchors=np.where(chosen[:, None], self.points, self.anchors))


def crease_band(
    vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], differential: Differential, cell: float
) -> Band:
    """Find the vertices near creases, project them by a Newton step, and give each the plane of its side.

    Args:
        vertices: Of marching cubes.
        faces: Counter-clockwise seen from outside.
        differential: Points -> signed distances and gradients.
        cell: Edge of a cell of the grid.
    """
    marked = _mark_bent(vertices, faces)
    chosen, own_faces = np.flatnonzero(marked), np.flatnonzero(marked[faces].all(axis=1))
    number = np.full(len(vertices), -1)
    number[chosen] = np.arange(len(chosen))
    corners = number[faces[own_faces]]
    sdf, gradients = differential(vertices[chosen])
    steepness = np.linalg.norm(gradients, axis=1)
    normals = gradients / np.maximum(steepness, np.finfo(float).tiny)[:, None]
    step = np.clip(sdf / np.maximum(steepness, FLATTEST), -LONGEST_STEP * cell, LONGEST_STEP * cell)
    points = vertices[chosen] - step[:, None] * normals
    source = _choose_sources(points, normals, corners, cell)
    sides = normals[source]
    rim = np.zeros(len(vertices), dtype=bool)
    rim[faces[~marked[faces].all(axis=1)]] = True
    return Band(chosen, own_faces, corners, points, sides, points[source], normals, rim[chosen])


def _mark_bent(vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]) -> Bool[ndarray, " v"]:
    """Mark the vertices within `RINGS` of faces across which the mesh bends."""
    a, b, c = vertices[faces.T]
    weighted = np.cross(b - a, c - a)
    sums = [np.bincount(faces.ravel(), np.repeat(column, 3), len(vertices)) for column in weighted.T]
    corners = unit(np.stack(sums, axis=1))[faces]
    cosines = np.einsum("fcd,fcd->fc", corners, np.roll(corners, -1, axis=1)).min(axis=1, initial=1.0)
    marked = np.zeros(len(vertices), dtype=bool)
    marked[faces[cosines < np.cos(BEND)]] = True
    for _ in range(RINGS):
        marked[faces[marked[faces].any(axis=1)]] = True
    return marked


def _choose_sources(
    points: Float[ndarray, "b 3"], normals: Float[ndarray, "b 3"], corners: Int[ndarray, "f 3"], cell: float
) -> Int[ndarray, " b"]:
    """The vertex whose tangent plane each vertex takes over, handed on from neighbour to neighbour."""
    edges = edges_of(corners, len(points))
    pairs = np.concatenate([edges, edges[:, ::-1]])
    lengths = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1) / cell
    cosines = np.einsum("ij,ij->i", normals[pairs[:, 0]], normals[pairs[:, 1]])
    turns = np.arccos(np.clip(cosines, -1, 1)) / np.maximum(lengths, SHORTEST)
    steepest = np.zeros(len(points))
    np.maximum.at(steepest, pairs[:, 0], turns)
    source, cost = np.arange(len(points)), TURN_COST * steepest
    for _ in range(ROUNDS):
        offered, taker = source[pairs[:, 0]], pairs[:, 1]
        apart = points[taker] - points[offered]
        offset = np.abs(np.einsum("ij,ij->i", apart, normals[offered])) / cell
        distance = np.linalg.norm(apart, axis=1) / cell
        price = TURN_COST * steepest[offered] + OFFSET_COST * offset**2 + DISTANCE_COST * distance
        better = np.flatnonzero((price < cost[taker]) & (distance < REACH))
        best = better[np.lexsort((offered[better], price[better], taker[better]))]
        taker, first = np.unique(taker[best], return_index=True)
        source[taker], cost[taker] = offered[best[first]], price[best[first]]
    return source


def edges_of(corners: Int[ndarray, "f 3"], count: int) -> Int[ndarray, "e 2"]:
    """Ends of the edges of faces, each edge once, the lower first, in ascending order.

    Args:
        corners: Vertices of the faces.
        count: Number of vertices.
    """
    return np.stack(np.divmod(np.unique(edge_keys(corners, count)), count), axis=1)
