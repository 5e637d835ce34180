"""Normals and signed distances from a point cloud alone, by surfels: oriented discs, one per point.

Each point gets a local plane (`local_planes.py`), oriented by the free space around the cloud (`orientation.py`). Where
the points leave a side in doubt, nothing is said. Surfels as in Pfister et al. (2000).
"""

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from jointsdf.data.free_space import FreeSpace
from jointsdf.data.local_planes import TINY, fit_planes
from jointsdf.data.orientation import orient_planes
from jointsdf.data.solid_cloud import SolidCloud
from jointsdf.geometry.cloud_statistics import eccentricity

NEIGHBOURS = 24  # of a point, among which its plane, and what stands between it and free space, are looked for
DISC_NEIGHBOUR = 4  # the distance to this neighbour is the disc's radius
BATCH = 1 << 16  # places whose distances are taken at once
NEAREST_DISCS = 6  # about a place: one of them is the nearest, all of them vote on the side
LEAST_ORIENTED = 4  # of the nearest discs that must have a normal for a vote
LEAST_FACING = 2  # of them that must face as the nearest does
OPPOSED = -0.9  # cosine to the nearest disc's normal below which another is the far side of a wall or gap
SURROUNDING = 16  # nearest points, which lie on all sides of a place over the surface
LARGEST_ECCENTRICITY = 0.5  # of a place among these, from which it is beyond a rim: see `cloud_statistics.eccentricity`


class Surfels:
    """The points of a cloud as oriented discs.

    Args:
        points: The cloud, area-uniform, network frame, inside the training box.
        planes: Unit normals of either sign, where they are known (`denoising.py`); None: found from the points.
        solid: Whether the cloud is of a solid, so that its winding number tells sides that free space does not, and
            closes what is missing (`solid_cloud.py`).

    Attributes:
        points: As given, then those that close what is missing.
        space: The space that the cloud leaves free.
        normals: Unit normal of each point, pointing outside; 0 where it is in doubt.
        radii: Of the discs, network length units: the distance to the fourth neighbour.
    """

    def __init__(
        self, points: Float[ndarray, "n 3"], planes: Float[ndarray, "n 3"] | None = None, *, solid: bool = False
    ) -> None:
        self.points, self.space = points, FreeSpace(points)
        distances, neighbours = self.space.tree.query(points, min(NEIGHBOURS, len(points) - 1) + 1, workers=-1)
        neighbours = neighbours[:, 1:]  # without the point itself
        if planes is None:
            normals, found = fit_planes(points[neighbours] - points[:, None])
        else:
            normals, found = planes, np.ones(len(points), dtype=bool)
        signs = orient_planes(points, self.space, normals, found, neighbours, leaky=solid)
        self.radii = distances[:, min(DISC_NEIGHBOUR, len(points) - 1)]
        if solid:
            whole = SolidCloud(points, normals, signs, self.space.tree)
            signs = whole.signs * found
        self.normals = signs[:, None] * normals
        if solid:
            self._add(*whole.cover(self.space))

    def _add(self, points: Float[ndarray, "m 3"], normals: Float[ndarray, "m 3"]) -> None:
        """Take further discs."""
        self.points, self.normals = np.concatenate([self.points, points]), np.concatenate([self.normals, normals])
        self.space.add(points)
        radii = self.space.tree.query(points, [min(DISC_NEIGHBOUR, len(self.points) - 1) + 1], workers=-1)[0][:, 0]
        self.radii = np.concatenate([self.radii, radii])

    def signed(self, points: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, " n"], Bool[ndarray, " n"]]:
        """Signed distance to the nearest disc, negative inside.

        The distance is that to the disc's plane over the disc; beside it that to its centre, less the mean offset of
        the nearest of points spread as densely. The sign is free space's own; near the surface that of the planes
        around, where they agree and points lie on all sides (not so beyond the rim of a thin wall); elsewhere that of
        an empty ball.

        Args:
            points: Where, in the training box.

        Returns:
            The distances, 0 where the sign is unknown, and a mark where it is known.
        """
        signs = self.space.sign(points).astype(float)
        distances = np.zeros(len(points))
        for start in range(0, len(points), BATCH):
            part = slice(start, start + BATCH)
            near = np.flatnonzero(signs[part] == 0)
            distances[part], signs[part][near] = self._measure(points[part], near)
        return signs * distances, signs != 0

    def _measure(
        self, points: Float[ndarray, "n 3"], near: Int[ndarray, " m"]
    ) -> tuple[Float[ndarray, " n"], Float[ndarray, " m"]]:
        """Distance to the nearest disc of all points, and sign of those with the indices `near`; 0 in doubt."""
        distances, nearest = self.space.tree.query(points, min(NEAREST_DISCS, len(self.points)), workers=-1)
        normals = self.normals[nearest]
        heights, oriented = ((points[:, None] - self.points[nearest]) * normals).sum(axis=2), normals.any(axis=2)
        over = oriented & (distances**2 - heights**2 <= self.radii[nearest] ** 2)
        apart = np.where(over, np.abs(heights), distances)
        first = normals[np.arange(len(points)), np.where(oriented, apart, np.inf).argmin(axis=1)][near]
        beside = np.sqrt(np.maximum(distances**2 - self.radii[nearest] ** 2 / 4, distances**2 / 4))
        apart = np.where(over, apart, beside).min(axis=1)
        return apart, self._find_side(points[near], heights[near], normals[near], first)

    def _find_side(
        self,
        points: Float[ndarray, "m 3"],
        heights: Float[ndarray, "m k"],
        normals: Float[ndarray, "m k 3"],
        first: Float[ndarray, "m 3"],
    ) -> Float[ndarray, " m"]:
        """Sign of each place by the planes around it, or else by an empty ball away from the surface; 0 in doubt."""
        around = self.space.tree.query(points, min(SURROUNDING, len(self.points)), workers=-1)[1]
        offsets = self.points[around] - points[:, None]
        amid = eccentricity(offsets, first) < LARGEST_ECCENTRICITY
        signs = amid * _vote_by_planes(heights, normals, first)
        for away in (-offsets[:, 0], -offsets.mean(axis=1)):
            left = np.flatnonzero(signs == 0)
            directions = away[left] / np.maximum(np.linalg.norm(away[left], axis=1, keepdims=True), TINY)
            signs[left] = self.space.sign_by_empty_ball(points[left], directions)
        return signs


def _vote_by_planes(
    heights: Float[ndarray, "n k"], normals: Float[ndarray, "n k 3"], first: Float[ndarray, "n 3"]
) -> Float[ndarray, " n"]:
    """Sign on which all planes about a place agree but those opposed to the nearest; 0 where they differ or are few."""
    oriented = normals.any(axis=2)
    facing = oriented & (np.einsum("nki,ni->nk", normals, first) > OPPOSED)
    votes, voters = (np.sign(heights) * facing).sum(axis=1), facing.sum(axis=1)
    clear = (oriented.sum(axis=1) >= LEAST_ORIENTED) & (voters >= LEAST_FACING) & (np.abs(votes) == voters)
    return np.where(clear, np.sign(votes), 0)
