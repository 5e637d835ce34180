"""Inside/outside of an unoriented point cloud by flood-filling empty space, 0 where the points leave it in doubt.

Space farther from every point than the widest gap between neighbours is free of surface. Free space connected to the
rim of the box is outside, other free space inside. Nearer to the surface a place has the side of an empty ball that
contains it and has its centre in free space. Inside walls thinner than twice the gap the sign stays unknown. A closed
cavity counts as inside.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.ndimage import binary_dilation, distance_transform_edt, label
from scipy.spatial import KDTree

from jointsdf.values import BOX

GAP_NEIGHBOUR = 10  # of n random points the widest gap is about the circle that holds log(n), 10 for 30,000
GAP_QUANTILE = 0.999  # of the points' distances to that neighbour
GAP_MARGIN = 1.2  # factor from that quantile to the reach
CELLS_PER_REACH = 2
LEAST_INSIDE_CELLS = 27  # of a free region inside: smaller ones can be the widest places of a gap between walls
CENTRE_DISTANCES = (1.5, 3, 6, 12)  # from a place to the centres of the empty balls tried, in units of the reach
MOST_CELLS = 256  # along each axis of the box, so that memory stays bounded; a cube's 30,000 points take 49


class FreeSpace:
    """Free space around a point cloud, with the side of the surface that it is on.

    Args:
        points: The cloud, area-uniform, network frame, inside the training box.

    Attributes:
        tree: The points of the cloud.
        reach: Distance from the cloud beyond which space counts as free, network length units.
        cells: Number of cells along each axis that the box is divided into.
        signs: Of each cell: 1 free and outside, -1 free and inside, 0 not free.
    """

    def __init__(self, points: Float[ndarray, "n 3"]) -> None:
        self.tree = KDTree(points)
        neighbour = min(GAP_NEIGHBOUR, len(points) - 1)
        gaps = self.tree.query(points, [neighbour + 1], workers=-1)[0]
        self.reach = max(GAP_MARGIN * float(np.quantile(gaps, GAP_QUANTILE)), 2 * BOX * CELLS_PER_REACH / MOST_CELLS)
        self.cells = int(np.ceil(2 * BOX / (self.reach / CELLS_PER_REACH)))
        free = ~self._near(points)
        regions, _ = label(free)
        rim = np.unique(np.concatenate([regions.take([0, -1], axis).ravel() for axis in range(3)]))
        outside = np.isin(regions, rim)
        known = free & (outside | (np.bincount(regions.ravel())[regions] >= LEAST_INSIDE_CELLS))
        self.signs = np.where(outside, 1, -1).astype(np.int8) * known

    def enclose(self, inside: Callable[[Float[ndarray, "n 3"]], Bool[ndarray, " n"]]) -> Float[ndarray, "m 3"]:
        """Make what a function marks of the free space outside, in regions that are not small, inside.

        Returns:
            The centres of its cells that border on what stays outside.
        """
        outside = np.argwhere(self.signs > 0)
        marked = np.zeros(self.signs.shape, dtype=bool)
        marked[tuple(outside.T)] = inside(self._centres(outside))
        regions, _ = label(marked)
        marked &= np.bincount(regions.ravel())[regions] >= LEAST_INSIDE_CELLS
        self.signs[marked] = -1
        border = marked & binary_dilation(self.signs > 0)
        return self._centres(np.argwhere(border))

    def add(self, points: Float[ndarray, "m 3"]) -> None:
        """Take further points of the surface, near which space is not free."""
        if len(points):
            self.tree = KDTree(np.concatenate([self.tree.data, points]))
            self.signs[self._near(points)] = 0

    def sign(self, points: Float[ndarray, "n 3"]) -> Int[ndarray, " n"]:
        """1 in free space outside, -1 in free space inside, 0 where space is not free.

        Args:
            points: Where, in the training box.
        """
        return self.signs[tuple(self._cell(points).T)]

    def sign_by_empty_ball(
        self, points: Float[ndarray, "n 3"], directions: Float[ndarray, "n 3"]
    ) -> Float[ndarray, " n"]:
        """Sign of an empty ball that contains each place and has its centre in free space; 0 where none is found.

        A surface that enters a ball between the points enters it no deeper than the cap whose base is a gap wide. So
        signs are known nearer to the surface than `reach`, where it is flat or curves away, as at the rim of a wall.

        Args:
            points: Where, in the training box.
            directions: Unit vectors from each place to the centres tried.
        """
        signs = np.zeros(len(points))
        for distance in CENTRE_DISTANCES:
            centres = points + distance * self.reach * directions
            asked = np.flatnonzero((signs == 0) & (np.abs(centres) < BOX).all(axis=1))
            asked = asked[self.sign(centres[asked]) != 0]
            radii = self.tree.query(centres[asked], workers=-1)[0]
            asked = asked[radii**2 > (1 + distance**2) * self.reach**2]
            signs[asked] = self.sign(centres[asked])
        return signs

    def _near(self, points: Float[ndarray, "n 3"]) -> Bool[ndarray, "c c c"]:
        """Mark of the cells within reach of the points."""
        empty = np.ones((self.cells,) * 3, dtype=bool)
        empty[tuple(self._cell(points).T)] = False
        return np.asarray(distance_transform_edt(empty, sampling=2 * BOX / self.cells) <= self.reach)

    def _centres(self, cells: Int[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        return (cells + 0.5) * (2 * BOX / self.cells) - BOX

    def _cell(self, points: Float[ndarray, "n 3"]) -> Int[ndarray, "n 3"]:
        return np.clip((points + BOX) * (self.cells / (2 * BOX)), 0, self.cells - 1).astype(np.int64)
