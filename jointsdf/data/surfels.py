"""What surface points alone tell of the surface near them: normals, and signed distances down to the surface itself.

A point's plane is, of those through it and two neighbours, the one that most neighbours lie in, so that those on the
other face of an edge, or on the far side of a thin wall, do not tilt it. Which side of the plane is outside is told by
the free space (`free_space.py`) that is first met along the normal, where nothing lies between; points that lie in one
another's planes agree on it. Where neither tells, nothing is said.
"""

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from jointsdf.data.free_space import FreeSpace
from jointsdf.geometry.topology import components
from jointsdf.values import BOX

PLANE_NEIGHBOURS, AROUND = 16, 24  # that may lie in a point's plane; that may lie between a point and free space
PAIRED, LEAST_SINE = 8, 0.3  # neighbours whose pairs span planes, where the angle between them is not too narrow
WIDTH, WIDER, ROUNDS = 0.02, 2.5, 3  # of a plane in radii of the neighbourhood; at first; rounds of fitting
BROAD = 0.02  # of the points in a plane, their spread across over that along: less is a line, which lies in any plane
AGREEING = 0.375  # share of the neighbours that must lie in a plane
RISE = 0.25  # sine of the angle above its plane from which a neighbour stands in a point's way
ALIKE, FLAT = 0.9, 0.15  # cosine between normals, and sine above each other's plane, of points that agree
STRIDE, STRIDES, CLEAR = 1.3, 14, 0.7  # along the normal; no point may be nearer than this share of the way
MAJORITY = 0.8  # of the votes, those for the other side taken off, among points that agree
ASKED, ANSWERING, FACING = 6, 4, 2  # discs about a place; of them with a normal at least; and facing it
SURROUNDING, CENTRAL = 16, 0.5  # points about a place; how far off their middle it may be, in their mean distance
OPPOSED = -0.9  # cosine to the nearest disc's normal below which another is the far side of a wall or gap
TINY = np.finfo(float).tiny
BATCH, PLACES = 4096, 1 << 16  # points whose planes are fitted at once; places asked at once
DISC_NEIGHBOUR = 4  # a surfel is a disc as wide as the distance to this neighbour


class Surfels:
    """The points of a cloud as small oriented discs.

    Args:
        points: The cloud, area-uniform, network frame, inside the training box.

    Attributes:
        points: As given.
        space: The space that the cloud leaves free.
        normals: Unit normal of each point, pointing outside; 0 where the points do not tell.
        radii: Of the discs, network length units: the distance to the fourth neighbour.
    """

    def __init__(self, points: Float[ndarray, "n 3"]) -> None:
        self.points, self.space = points, FreeSpace(points)
        distances, neighbours = self.space.tree.query(points, min(AROUND, len(points) - 1) + 1, workers=-1)
        offsets = points[neighbours[:, 1:]] - points[:, None]
        parts = [_planes(part) for part in np.array_split(offsets[:, :PLANE_NEIGHBOURS], len(points) // BATCH + 1)]
        planes, found = (np.concatenate(column) for column in zip(*parts, strict=True))
        sides = np.zeros(len(points))
        for side in (1.0, -1.0):
            sides += side * self._first_free(np.flatnonzero(found), side * planes, offsets)
        sides = _agreed(np.sign(sides), planes, found, neighbours[:, 1:], offsets)
        self.normals = sides[:, None] * planes
        self.radii = distances[:, min(DISC_NEIGHBOUR, len(points) - 1)]

    def signed(self, points: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, " n"], Bool[ndarray, " n"]]:
        """Distance to the nearest disc, negative inside, and where its sign is known; 0 elsewhere.

        The distance is that to the disc's plane over the disc; beside it that to its centre, less what points spread as
        densely are beside the foot on average. The sign is free space's own, and near the surface that of the planes
        around, where they agree and points lie on all sides, not as beyond the rim of a thin wall; elsewhere that of an
        empty ball.

        Args:
            points: Where, in the training box.
        """
        signs = self.space.sign(points).astype(float)
        distances = np.zeros(len(points))
        for start in range(0, len(points), PLACES):
            part = slice(start, start + PLACES)
            near = np.flatnonzero(signs[part] == 0)
            distances[part], sides = self._nearest(points[part], near)
            signs[part][near] = sides
        return signs * distances, signs != 0

    def _nearest(
        self, points: Float[ndarray, "n 3"], near: Int[ndarray, " m"]
    ) -> tuple[Float[ndarray, " n"], Float[ndarray, " m"]]:
        """Distance to the nearest disc; and the side of those named near, by planes or balls, 0 where neither tells."""
        distances, nearest = self.space.tree.query(points, min(ASKED, len(self.points)), workers=-1)
        normals = self.normals[nearest]
        heights, known = ((points[:, None] - self.points[nearest]) * normals).sum(axis=2), normals.any(axis=2)
        over = known & (distances**2 - heights**2 <= self.radii[nearest] ** 2)
        apart = np.where(over, np.abs(heights), distances)
        first = normals[np.arange(len(points)), np.where(known, apart, np.inf).argmin(axis=1)][near]
        beside = np.sqrt(np.maximum(distances**2 - self.radii[nearest] ** 2 / 4, distances**2 / 4))
        apart = np.where(over, apart, beside).min(axis=1)
        around = self.space.tree.query(points[near], min(SURROUNDING, len(self.points)), workers=-1)[1]
        offsets = self.points[around] - points[near, None]
        sides = (_off_centre(offsets, first) < CENTRAL) * _side(heights[near], normals[near], first)
        for away in (-offsets[:, 0], -offsets.mean(axis=1)):
            left = np.flatnonzero(sides == 0)
            directions = away[left] / np.maximum(np.linalg.norm(away[left], axis=1, keepdims=True), TINY)
            sides[left] = self.space.by_ball(points[near[left]], directions)
        return apart, sides

    def _first_free(
        self, asked: Int[ndarray, " m"], directions: Float[ndarray, "n 3"], offsets: Float[ndarray, "n k 3"]
    ) -> Float[ndarray, " n"]:
        """Sign of the free space first met from the asked points along their directions; 0 where points lie between."""
        signs = np.zeros(len(directions))
        rises = np.einsum("nki,ni->nk", offsets[asked], directions[asked])
        lengths = np.linalg.norm(offsets[asked], axis=2)
        asked, way = (values[(rises <= RISE * lengths).all(axis=1)] for values in (asked, lengths[:, -1]))
        for _ in range(STRIDES):
            places = self.points[asked] + way[:, None] * directions[asked]
            clear = (np.abs(places) < BOX).all(axis=1)
            clear &= self.space.tree.query(places, workers=-1)[0] > CLEAR * way
            asked, way, free = asked[clear], way[clear], self.space.sign(places[clear])
            signs[asked] = free
            asked, way = asked[free == 0], STRIDE * way[free == 0]
        return signs


def _side(
    heights: Float[ndarray, "n k"], normals: Float[ndarray, "n k 3"], first: Float[ndarray, "n 3"]
) -> Float[ndarray, " n"]:
    """The side of the planes about each place, where enough are known and agree but for those behind the nearest."""
    known = normals.any(axis=2)
    facing = known & (np.einsum("nki,ni->nk", normals, first) > OPPOSED)
    votes, voters = (np.sign(heights) * facing).sum(axis=1), facing.sum(axis=1)
    told = (known.sum(axis=1) >= ANSWERING) & (voters >= FACING) & (np.abs(votes) == voters)
    return np.where(told, np.sign(votes), 0)


def _off_centre(offsets: Float[ndarray, "n k 3"], normals: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
    """How far the middle of points is from each place, in their mean distance, all seen along a normal: 0 amid them."""
    flat = offsets - np.einsum("nki,ni->nk", offsets, normals)[..., None] * normals[:, None]
    return np.asarray(
        np.linalg.norm(flat.mean(axis=1), axis=1) / np.maximum(np.linalg.norm(flat, axis=2).mean(axis=1), TINY)
    )


def _planes(offsets: Float[ndarray, "n k 3"]) -> tuple[Float[ndarray, "n 3"], Bool[ndarray, " n"]]:
    """Unit normal, of either sign, of the plane through each point that most neighbours lie in; whether enough do."""
    if offsets.shape[1] < 2:
        return np.zeros((len(offsets), 3)), np.zeros(len(offsets), dtype=bool)
    one, other = np.triu_indices(min(PAIRED, offsets.shape[1]), 1)
    lengths = np.linalg.norm(offsets, axis=2)
    across = np.cross(offsets[:, one], offsets[:, other])
    sizes = np.linalg.norm(across, axis=2, keepdims=True)
    wide = sizes[..., 0] > LEAST_SINE * lengths[:, one] * lengths[:, other]
    candidates = np.divide(across, sizes, out=np.zeros_like(across), where=sizes > 0)
    width = WIDTH * lengths[:, -1:]
    within = _within(offsets @ candidates.transpose(0, 2, 1), WIDER * width[:, None]).sum(axis=1) * wide
    planes = candidates[np.arange(len(offsets)), within.argmax(axis=1)]
    for wider in np.geomspace(WIDER, 1, ROUNDS):
        weights = _within(np.einsum("nki,ni->nk", offsets, planes), wider * width)
        spread, axes = np.linalg.eigh(np.einsum("nk,nki,nkj->nij", weights, offsets, offsets, optimize=True))
        planes = axes[:, :, 0]
    agreeing = _within(np.einsum("nki,ni->nk", offsets, planes), width).mean(axis=1) > AGREEING
    return planes, agreeing & (spread[:, 1] > BROAD * spread[:, 2])


def _within(heights: Float[ndarray, "*s"], width: Float[ndarray, "*t"]) -> Float[ndarray, "*s"]:
    """1 in a plane, falling to 0 beyond its width."""
    return np.asarray(1 / (1 + (heights / np.maximum(width, TINY)) ** 2) ** 2)


def _agreed(
    sides: Float[ndarray, " n"],
    planes: Float[ndarray, "n 3"],
    found: Bool[ndarray, " n"],
    neighbours: Int[ndarray, "n k"],
    offsets: Float[ndarray, "n k 3"],
) -> Float[ndarray, " n"]:
    """The side of each point that those agree on which lie in one another's planes; its own where they do not.

    Every point stands there twice, once turned over; linked are those that point the same way.
    """
    count, (one, place) = len(sides), np.nonzero(np.broadcast_to(found[:, None], neighbours.shape))
    other, offset = neighbours[one, place], offsets[one, place]
    flat = FLAT * np.linalg.norm(offset, axis=1)
    cosines = (planes[one] * planes[other]).sum(axis=1)
    linked = found[other] & (np.abs(cosines) > ALIKE)
    for ends in (one, other):
        linked &= np.abs((offset * planes[ends]).sum(axis=1)) < flat
    one, other, turned = one[linked], other[linked], count * (cosines[linked] < 0)
    pairs = np.stack([[one, one + count], [other + turned, other + count - turned]], axis=-1).reshape(-1, 2)
    group = components(pairs, 2 * count)
    both = np.concatenate([sides, -sides])
    votes, voters = np.bincount(group, both), np.bincount(group, np.abs(both))
    decided = np.abs(votes) > MAJORITY * voters
    return np.where(decided[group[:count]], np.sign(votes)[group[:count]], sides) * found
