"""Sides of a cloud's planes, and a cover over what it lacks, if it is of a solid: by its winding number.

Where the planes are right, so is the gradient of the winding number, which in turn tells on which side of each plane
the inside is: signs and winding number are found in turns (winding-number normal consistency, Lin, Shi and Liu 2024),
from what free space tells. Where a piece of the surface is missing, free space outside and inside are one region, and
the level 1/2 of the winding number closes it smoothly.
"""

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.spatial import KDTree
from skimage.measure import marching_cubes

from jointsdf.data.free_space import FreeSpace
from jointsdf.data.winding_field import WindingField
from jointsdf.geometry.mesh import unit

AREA_NEIGHBOUR = 8  # a point's area is a share of the circle through this neighbour
MOST_AREA = 4.0  # of a point, in median areas: points at rims have no more
MOST_ROUNDS = 20
SETTLED = 5e-4  # mean change of belief in a round, below which it is the last
FIRST_GUESS = 0.3  # of the side that looks away from the middle of the cloud, where free space tells none
WHOLE_STEP = 0.5  # fall of the winding number across a plane from which its side is believed wholly
CLEAR = 0.6  # fall of the winding number from which it tells the side: it is less across walls of few cells
ROOM = 0.9  # of the way to a place beside a point: no other point is nearer to it, or the wall is too thin for the grid
STEP = 1.5  # from a point to the places on both sides, in cells
INSIDE = 0.5
APART = 1.5  # distance of the cover from the points, in their spacings
NEAR = 1.5  # of the cover to the border of free space inside with that outside, in reaches: so it meets the points


class SolidCloud:
    """Winding number of the points of a solid's surface.

    Args:
        points: The cloud, network frame, inside the training box.
        planes: Unit normals of either sign.
        signs: 1 or -1 where free space tells the side of a plane, otherwise 0.
        tree: Of the points.

    Attributes:
        signs: That turn the normals outside; 0 in doubt.
    """

    def __init__(
        self, points: Float[ndarray, "n 3"], planes: Float[ndarray, "n 3"], signs: Float[ndarray, " n"], tree: KDTree
    ) -> None:
        neighbour = min(AREA_NEIGHBOUR, len(points) - 1)
        areas = np.pi * tree.query(points, [neighbour + 1], workers=-1)[0][:, 0] ** 2 / neighbour
        usual = float(np.median(areas))
        self._points, self._planes, self._spacing = points, planes, float(np.sqrt(usual))
        self._dipoles = np.minimum(areas, MOST_AREA * usual)[:, None] * planes
        self._field = WindingField(points, self._spacing)
        self._step = STEP * self._field.cell
        room = [tree.query(points + side * self._step * planes, workers=-1)[0] for side in (1, -1)]
        self.signs = self._find_sides(signs, np.minimum(*room) > ROOM * self._step)
        self._values = self._field.solve(self.signs[:, None] * self._dipoles)

    def _find_sides(self, signs: Float[ndarray, " n"], roomy: Bool[ndarray, " n"]) -> Float[ndarray, " n"]:
        """Signs of the planes, those of free space where the winding number does not tell them.

        Args:
            signs: What free space tells, 0 in doubt.
            roomy: Whether there is room for the grid on both sides of each plane. Elsewhere free space is believed.
        """
        away = np.sign(((self._points - self._points.mean(axis=0)) * self._planes).sum(axis=1))
        belief, step = np.where(signs == 0, FIRST_GUESS * away, signs), self._step * self._planes
        for _ in range(MOST_ROUNDS):
            values = self._field.solve(belief[:, None] * self._dipoles)
            behind, before = (self._field.at(values, places) for places in (self._points - step, self._points + step))
            found = np.clip((behind - before) / WHOLE_STEP, -1, 1)
            changed = np.where(roomy | (signs == 0), found, signs)
            settled = np.abs(changed - belief).mean() < SETTLED
            belief = changed
            if settled:
                break
        through = roomy & ((behind > INSIDE) != (before > INSIDE)) & (np.abs(behind - before) > CLEAR)
        return np.where(through, np.sign(belief), signs)

    def at(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """Winding number at points of the box, smoothed: about 1 inside, 0 outside."""
        return self._field.at(self._values, points)

    def cover(self, space: FreeSpace) -> tuple[Float[ndarray, "m 3"], Float[ndarray, "m 3"]]:
        """Points and outward normals of a smooth surface over what is missing; free space behind it becomes inside.

        Args:
            space: Free space of the cloud, which is changed.
        """
        near = space.enclose(lambda places: self.at(places) > INSIDE)
        if not len(near):
            return np.zeros((0, 3)), np.zeros((0, 3))
        vertices, _, normals, _ = marching_cubes(self._values, INSIDE)
        points = self._field.centre(vertices)
        chosen = KDTree(near).query(points, workers=-1)[0] < NEAR * space.reach
        chosen &= space.tree.query(points, workers=-1)[0] > APART * self._spacing
        return points[chosen], unit(normals[chosen].astype(np.float64))
