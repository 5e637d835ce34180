"""Orientation of the local planes of a point cloud: by the free space met along the normal, then by agreement.

Points that lie in one another's planes must agree, as in Hoppe et al., "Surface Reconstruction from Unorganized Points"
(1992); here a vote within connected groups takes the place of their propagation along a spanning tree.
"""

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from jointsdf.data.free_space import FreeSpace
from jointsdf.geometry.topology import components
from jointsdf.values import BOX

LARGEST_RISE = 0.25  # sine of the angle above a point's plane from which a neighbour stands in the way to free space
STEP_GROWTH = 1.3  # of the distance along the normal, from one probe for free space to the next
STEPS = 14  # probes along a normal
CLEARANCE = 0.7  # of the distance along the normal: no point may be nearer to a probe
LEAST_COSINE = 0.9  # between the normals of points that lie in one another's planes
LARGEST_SINE = 0.15  # of the angle of each of them above the other's plane
MAJORITY = 0.8  # lead of the winning side, in shares of a group's votes, from which the group takes it


def orient_planes(
    points: Float[ndarray, "n 3"],
    space: FreeSpace,
    normals: Float[ndarray, "n 3"],
    found: Bool[ndarray, " n"],
    neighbours: Int[ndarray, "n k"],
    *,
    leaky: bool = False,
) -> Float[ndarray, " n"]:
    """Sign that turns each normal outside; 0 where there is no plane or no side is clear.

    Args:
        points: The cloud, network frame.
        space: Its free space.
        normals: Unit normals of either sign.
        found: Marks the points that have a plane.
        neighbours: Indices of the points around each, nearest first.
        leaky: Whether points with free space of one kind on both sides, as where it leaks in, speak against any side
            of their group.
    """
    offsets = points[neighbours] - points[:, None]
    asked = np.flatnonzero(found)
    front, back = (_find_free_side(points, space, asked, side * normals, offsets) for side in (1.0, -1.0))
    against = leaky & (front * back > 0)
    return _propagate_orientation(np.sign(front - back), against, normals, found, neighbours, offsets)


def _find_free_side(
    points: Float[ndarray, "n 3"],
    space: FreeSpace,
    asked: Int[ndarray, " m"],
    directions: Float[ndarray, "n 3"],
    offsets: Float[ndarray, "n k 3"],
) -> Float[ndarray, " n"]:
    """Sign of the free space first met from the asked points along their directions; 0 where points lie between."""
    signs = np.zeros(len(directions))
    rises = np.einsum("nki,ni->nk", offsets[asked], directions[asked])
    lengths = np.linalg.norm(offsets[asked], axis=2)
    clear = (rises <= LARGEST_RISE * lengths).all(axis=1)
    asked, way = asked[clear], lengths[:, -1][clear]
    for _ in range(STEPS):
        places = points[asked] + way[:, None] * directions[asked]
        clear = (np.abs(places) < BOX).all(axis=1)
        clear &= space.tree.query(places, workers=-1)[0] > CLEARANCE * way
        asked, way, free = asked[clear], way[clear], space.sign(places[clear])
        signs[asked] = free
        asked, way = asked[free == 0], STEP_GROWTH * way[free == 0]
    return signs


def _propagate_orientation(
    signs: Float[ndarray, " n"],
    against: Bool[ndarray, " n"],
    normals: Float[ndarray, "n 3"],
    found: Bool[ndarray, " n"],
    neighbours: Int[ndarray, "n k"],
    offsets: Float[ndarray, "n k 3"],
) -> Float[ndarray, " n"]:
    """Majority sign of each group of points that lie in one another's planes; a point's own where there is none.

    In the graph every point is two nodes, one of them turned over; edges connect those that point the same way.
    """
    count, (one, place) = len(signs), np.nonzero(np.broadcast_to(found[:, None], neighbours.shape))
    other, offset = neighbours[one, place], offsets[one, place]
    flat = LARGEST_SINE * np.linalg.norm(offset, axis=1)
    cosines = (normals[one] * normals[other]).sum(axis=1)
    linked = found[other] & (np.abs(cosines) > LEAST_COSINE)
    for ends in (one, other):
        linked &= np.abs((offset * normals[ends]).sum(axis=1)) < flat
    one, other, turned = one[linked], other[linked], count * (cosines[linked] < 0)
    pairs = np.stack([[one, one + count], [other + turned, other + count - turned]], axis=-1).reshape(-1, 2)
    group = components(pairs, 2 * count)
    both = np.concatenate([signs, -signs])
    votes, voters = np.bincount(group, both), np.bincount(group, np.abs(both) + np.tile(against, 2))
    decided = np.abs(votes) > MAJORITY * voters
    return np.where(decided[group[:count]], np.sign(votes)[group[:count]], signs) * found
