"""Sides of the surface from surface points alone, where the points leave no doubt.

Space farther from every point than the widest gap between neighbours is free of surface. Free space that reaches the
box's rim is outside; free space that does not is inside. Nearer than that, the side of a place is told where an empty
ball about free space holds it, and inside walls thinner than twice it nothing is said. A closed cavity is taken for
inside.
"""

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.ndimage import distance_transform_edt, label
from scipy.spatial import KDTree

from jointsdf.values import BOX

# Among n random points the widest gap is about as wide as the circle that holds log(n), 10 for 30,000.
GAP_NEIGHBOUR, GAP_QUANTILE, GAP_MARGIN = 10, 0.999, 1.2
LEAST_CELLS = 27  # of a free region within: smaller ones can be the widest places of a gap between walls
CENTRES = (1.5, 3, 6, 12)  # of empty balls, from a place in them, in units of the reach
FINEST = 256  # cells along each axis of the box, so that memory stays bounded; a cube's 30,000 points take 49


class FreeSpace:
    """The space that a point cloud leaves free, and which side of the surface it is on.

    Args:
        points: The cloud, area-uniform, network frame, inside the training box.

    Attributes:
        tree: The cloud.
        reach: Distance from the cloud beyond which space counts as free, network length units.
        signs: 1 outside, -1 inside, 0 where space is not free, of the cells that the box is cut into.
    """

    def __init__(self, points: Float[ndarray, "n 3"]) -> None:
        self.tree = KDTree(points)
        neighbour = min(GAP_NEIGHBOUR, len(points) - 1)
        gaps = self.tree.query(points, [neighbour + 1], workers=-1)[0]
        self.reach = max(GAP_MARGIN * float(np.quantile(gaps, GAP_QUANTILE)), 4 * BOX / FINEST)
        self.cells = int(np.ceil(2 * BOX / (self.reach / 2)))
        empty = np.ones((self.cells,) * 3, dtype=bool)
        empty[tuple(self._cell(points).T)] = False
        free = distance_transform_edt(empty, sampling=2 * BOX / self.cells) > self.reach
        regions, _ = label(free)
        rim = np.unique(np.concatenate([regions.take([0, -1], axis).ravel() for axis in range(3)]))
        outside = np.isin(regions, rim)
        told = free & (outside | (np.bincount(regions.ravel())[regions] >= LEAST_CELLS))
        self.signs = np.where(outside, 1, -1).astype(np.int8) * told

    def sign(self, points: Float[ndarray, "n 3"]) -> Int[ndarray, " n"]:
        """1 in free space outside, -1 in free space inside, 0 where the points do not tell.

        Args:
            points: Where, in the training box.
        """
        return self.signs[tuple(self._cell(points).T)]

    def by_ball(self, points: Float[ndarray, "n 3"], directions: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """The side of an empty ball that holds each place and has its centre in free space; 0 where none is found.

        A surface that enters a ball between the points enters it no deeper than the cap whose base is a gap wide. So
        sides are known nearer to the surface than `reach`, where it is flat or curves away, as at the rim of a wall.

        Args:
            points: Where, in the training box.
            directions: Unit vectors along which the centres are looked for.
        """
        signs = np.zeros(len(points))
        for steps in CENTRES:
            centres = points + steps * self.reach * directions
            asked = np.flatnonzero((signs == 0) & (np.abs(centres) < BOX).all(axis=1))
            asked = asked[self.sign(centres[asked]) != 0]
            radii = self.tree.query(centres[asked], workers=-1)[0]
            asked = asked[radii**2 > (1 + steps**2) * self.reach**2]
            signs[asked] = self.sign(centres[asked])
        return signs

    def _cell(self, points: Float[ndarray, "n 3"]) -> Int[ndarray, "n 3"]:
        return np.clip((points + BOX) * (self.cells / (2 * BOX)), 0, self.cells - 1).astype(np.int64)
