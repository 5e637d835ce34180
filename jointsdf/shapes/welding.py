"""Welding of the corners along a mesh's open edges that rounding has moved apart."""

import logging

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.spatial import KDTree

from jointsdf.geometry.topology import components, is_closed, side_uses

REACH = 1e-6  # distance of corners that are welded, of the longest side
ROUNDINGS = 4  # the same in float32 steps of the largest coordinate, where the coordinates are float32 numbers
LEAST = 0.5  # share of the edges without exactly two faces that must vanish
LARGEST = 1e-3  # of the longest side: corners further apart are never welded

logger = logging.getLogger(__name__)


def weld(source: str, vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]) -> Float[ndarray, "v 3"] | None:
    """Move the corners of open edges that are nearer than a tolerance to the first of them; None where that is idle.

    Corners are welded only where most of the edges without exactly two faces vanish by it, so a closed mesh is left
    alone, and so are the rims of holes.

    Args:
        source: Names the mesh in messages.
        vertices: Positions, merged by position unless the mesh is closed.
        faces: Vertex indices, no degenerate face.
    """
    if is_closed(faces):
        return None
    uses = side_uses(faces)
    open_sides = uses == 1
    corners = np.unique([faces[open_sides], np.roll(faces, -1, axis=1)[open_sides]])
    size = float(np.ptp(vertices, axis=0).max())
    tolerance = _tolerance(vertices, size)
    if len(corners) == 0 or tolerance > LARGEST * size:
        return None
    pairs = KDTree(vertices[corners]).query_pairs(tolerance, output_type="ndarray")
    group = components(pairs, len(corners))
    first = np.unique(group, return_index=True)[1]
    target = np.arange(len(vertices))
    target[corners] = corners[first[group]]
    after = target[faces]
    after = after[(after != np.roll(after, -1, axis=1)).all(axis=1)]
    if len(after) == 0 or _count_odd(side_uses(after)) > (1 - LEAST) * _count_odd(uses):
        return None
    welded = int((target != np.arange(len(target))).sum())
    logger.warning("%s: %d vertices within %.1g of the longest side welded", source, welded, tolerance / size)
    return vertices[target]


def _tolerance(vertices: Float[ndarray, "v 3"], size: float) -> float:
    """Distance of corners that are welded, in the unit of the vertices."""
    with np.errstate(over="ignore"):
        single = vertices.astype(np.float32)
    steps = float(np.spacing(np.abs(single).max())) if (single == vertices).all() else 0.0
    return max(REACH * size, ROUNDINGS * steps)


def _count_odd(uses: Int[ndarray, "f 3"]) -> float:
    """Number of edges that do not have exactly two faces."""
    return float((1 / uses[uses != 2]).sum())
