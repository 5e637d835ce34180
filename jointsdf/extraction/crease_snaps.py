"""Vertices that are close to a crease or a corner and move onto it, so that no sliver is cut off beside it."""

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from jointsdf.extraction.crease_band import Band
from jointsdf.extraction.crease_lines import Crossings
from jointsdf.geometry.mesh import unit

TO_CREASE, TO_CORNER = 0.2, 0.5  # farthest that a vertex moves onto a crease or a corner, cells
SPACING = 0.3  # least distance of two vertices that move onto a crease, cells
ONE_SIDE = np.cos(np.radians(25.0))  # between the planes across from a vertex that are of one side
WEAK = 0.05  # eigenvalue of three planes' normals below which they leave a direction open


def snap_to_creases(
    band: Band, crossings: Crossings, points: Float[ndarray, "b 3"], at_corner: Bool[ndarray, " b"], cell: float
) -> tuple[Bool[ndarray, " b"], Float[ndarray, "b 3"]]:
    """Choose vertices that are close to a crease, no two of them close together or across from each other.

    Args:
        band: With the planes.
        crossings: Edges that creases run across.
        points: Of the band's vertices.
        at_corner: Marks the vertices of faces that hold a corner, which stay.
        cell: Edge of a cell of the grid.

    Returns:
        The choice, and for each vertex with a crossing the nearest place on its crease.
    """
    count, own = len(points), crossings.ends.ravel()
    depth = np.zeros(count)
    np.maximum.at(depth, own, np.abs(crossings.depths(points)).ravel())
    across = band.normals[crossings.ends[:, ::-1]].reshape(-1, 3)
    along = np.einsum("esd,ed->es", points[crossings.ends] - crossings.origins[:, None], crossings.directions)
    nearest = crossings.origins[:, None] + along[..., None] * crossings.directions[:, None]
    target = _sums(own, nearest.reshape(-1, 3), count) / np.maximum(np.bincount(own, minlength=count), 1)[:, None]
    candidate = np.zeros(count, dtype=bool)
    candidate[own] = depth[own] < TO_CREASE * cell
    candidate[own[np.einsum("ed,ed->e", across, unit(_sums(own, across, count))[own]) < ONE_SIDE]] = False
    candidate &= ~at_corner
    pairs = band.edges[candidate[band.edges].all(axis=1)]
    close = np.linalg.norm(target[pairs[:, 0]] - target[pairs[:, 1]], axis=1) < SPACING * cell
    close |= np.isin(pairs @ [count, 1], crossings.ends @ [count, 1])
    chosen = independent_set(candidate, pairs[close], depth)
    whole = band.corners[chosen[band.corners].all(axis=1)]
    chosen[whole[np.arange(len(whole)), depth[whole].argmax(axis=1)]] = False
    return chosen, target


def snap_to_corners(
    band: Band, corners: Int[ndarray, "c 3"], points: Float[ndarray, "b 3"], cell: float
) -> tuple[Bool[ndarray, " b"], Float[ndarray, "b 3"]]:
    """Choose the vertex nearest to the corner in each face that holds one, where it is close.

    Args:
        band: With the planes.
        corners: Vertices of the faces, each on a side of its own.
        points: Of the band's vertices.
        cell: Edge of a cell of the grid.

    Returns:
        The choice, and the place of each vertex that is chosen.
    """
    places = corner_points(band, corners, points[corners].mean(axis=1), cell)
    distances = np.linalg.norm(points[corners] - places[:, None], axis=2)
    order = np.argsort(-distances.min(axis=1), kind="stable")  # of two corners a vertex takes the nearer
    order = order[distances[order].min(axis=1) < TO_CORNER * cell]
    taken = corners[order, distances[order].argmin(axis=1)]
    chosen, target = np.zeros(len(points), dtype=bool), np.zeros_like(points)
    chosen[taken], target[taken] = True, places[order]
    return chosen, target


def corner_points(
    band: Band, corners: Int[ndarray, "c 3"], starts: Float[ndarray, "c 3"], cell: float
) -> Float[ndarray, "c 3"]:
    """The points nearest to the planes of three sides, by least squares; at most a cell from the starts."""
    normals = band.normals[corners]
    offsets = np.einsum("ckd,ckd->ck", normals, band.anchors[corners] - starts[:, None])
    values, axes = np.linalg.eigh(np.einsum("cki,ckj->cij", normals, normals))
    inverse = np.where(values > WEAK, 1 / np.maximum(values, WEAK), 0.0)
    along = inverse * np.einsum("cij,ci->cj", axes, np.einsum("cki,ck->ci", normals, offsets))
    moves = np.einsum("cij,cj->ci", axes, along)
    lengths = np.linalg.norm(moves, axis=1, keepdims=True)
    return starts + moves * np.minimum(1.0, cell / np.maximum(lengths, np.finfo(float).tiny))


def independent_set(
    candidate: Bool[ndarray, " b"], conflicts: Int[ndarray, "c 2"], cost: Float[ndarray, " b"]
) -> Bool[ndarray, " b"]:
    """A maximal set of candidates without a conflict, by rounds in which those beaten by no neighbour are taken.

    Source: Luby, "A simple parallel algorithm for the maximal independent set problem" (1986), here by given costs.

    >>> independent_set(np.ones(3, dtype=bool), np.array([[0, 1], [1, 2]]), np.array([2.0, 3.0, 1.0]))
    array([ True, False,  True])
    """
    rank = np.argsort(np.argsort(cost, kind="stable"))
    left, chosen = candidate.copy(), np.zeros_like(candidate)
    while left.any():
        conflicts = conflicts[left[conflicts].all(axis=1)]
        beaten = np.zeros_like(left)
        beaten[conflicts[np.arange(len(conflicts)), rank[conflicts].argmax(axis=1)]] = True
        winners = left & ~beaten
        chosen |= winners
        left &= ~winners
        left[conflicts[winners[conflicts].any(axis=1)]] = False
    return chosen


def _sums(rows: Int[ndarray, " n"], vectors: Float[ndarray, "n 3"], count: int) -> Float[ndarray, "b 3"]:
    """Sum of the vectors of each row."""
    return np.stack([np.bincount(rows, column, count) for column in vectors.T], axis=1)
