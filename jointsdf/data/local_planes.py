"""Local planes of a point cloud by consensus of neighbour pairs, refined by reweighted least squares.

Every plane through a point and two near neighbours is a candidate, as in RANSAC (Fischler and Bolles 1981) but with all
pairs instead of random ones; the one that most neighbours lie in is refined with Geman-McClure weights. So neighbours
on the other face of an edge, or on the far side of a thin wall, do not tilt the plane.
"""

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

PLANE_NEIGHBOURS = 16  # nearest points that vote for a plane
PAIRED_NEIGHBOURS = 8  # nearest points whose pairs span the candidates
LEAST_SINE = 0.3  # of the angle between the neighbours of a pair: a narrower one spans no plane
PLANE_WIDTH = 0.02  # height above a plane at which a neighbour's weight is 1/4, in distances to the farthest neighbour
FIRST_WIDTH = 2.5  # of the consensus and the first round, in plane widths
ROUNDS = 3  # of reweighted least squares, the width falling geometrically to the plane's
LEAST_SPREAD = 0.02  # across over along, squared, of the points in a plane: less is a line, which lies in any plane
LEAST_WEIGHT = 0.375  # mean weight of the neighbours of a plane that counts as found
TINY = np.finfo(float).tiny
BATCH = 4096  # about so many points are fitted at once


def fit_planes(offsets: Float[ndarray, "n k 3"]) -> tuple[Float[ndarray, "n 3"], Bool[ndarray, " n"]]:
    """Plane through each point.

    Args:
        offsets: From each point to its neighbours, nearest first; the nearest `PLANE_NEIGHBOURS` are used.

    Returns:
        Unit normals, of either sign, and a mark where enough neighbours lie in the plane.

    >>> angles = np.arange(16)[:, None]
    >>> circle = np.concatenate([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    >>> normals, found = fit_planes(circle[None])
    >>> np.abs(normals).round(6).tolist(), found.tolist()
    ([[0.0, 0.0, 1.0]], [True])
    """
    offsets = offsets[:, :PLANE_NEIGHBOURS]
    parts = [_fit_planes(part) for part in np.array_split(offsets, len(offsets) // BATCH + 1)]
    normals, found = (np.concatenate(column) for column in zip(*parts, strict=True))
    return normals, found


def _fit_planes(offsets: Float[ndarray, "n k 3"]) -> tuple[Float[ndarray, "n 3"], Bool[ndarray, " n"]]:
    """`fit_planes` of one batch."""
    if offsets.shape[1] < 2:
        return np.zeros((len(offsets), 3)), np.zeros(len(offsets), dtype=bool)
    width = PLANE_WIDTH * np.linalg.norm(offsets, axis=2)[:, -1:]
    normals = _choose_by_consensus(offsets, FIRST_WIDTH * width)
    for factor in np.geomspace(FIRST_WIDTH, 1, ROUNDS):
        weights = geman_mcclure_weight(np.einsum("nki,ni->nk", offsets, normals), factor * width)
        spread, axes = np.linalg.eigh(np.einsum("nk,nki,nkj->nij", weights, offsets, offsets, optimize=True))
        normals = axes[:, :, 0]
    weights = geman_mcclure_weight(np.einsum("nki,ni->nk", offsets, normals), width)
    return normals, (weights.mean(axis=1) > LEAST_WEIGHT) & (spread[:, 1] > LEAST_SPREAD * spread[:, 2])


def _choose_by_consensus(offsets: Float[ndarray, "n k 3"], width: Float[ndarray, "n 1"]) -> Float[ndarray, "n 3"]:
    """Normal of the plane through each point and two neighbours with the largest sum of neighbours' weights."""
    one, other = np.triu_indices(min(PAIRED_NEIGHBOURS, offsets.shape[1]), 1)
    lengths = np.linalg.norm(offsets, axis=2)
    across = np.cross(offsets[:, one], offsets[:, other])
    sizes = np.linalg.norm(across, axis=2, keepdims=True)
    wide = sizes[..., 0] > LEAST_SINE * lengths[:, one] * lengths[:, other]
    candidates = np.divide(across, sizes, out=np.zeros_like(across), where=sizes > 0)
    heights = offsets @ candidates.transpose(0, 2, 1)
    votes = geman_mcclure_weight(heights, width[:, None]).sum(axis=1) * wide
    return candidates[np.arange(len(offsets)), votes.argmax(axis=1)]


def geman_mcclure_weight(heights: Float[ndarray, "*s"], width: Float[ndarray, "*t"]) -> Float[ndarray, "*s"]:
    """Geman-McClure weight (1987), 1 / (1 + (height / width)^2)^2: 1 in a plane, falling to 0 beyond its width."""
    return np.asarray(1 / (1 + (heights / np.maximum(width, TINY)) ** 2) ** 2)
