"""A field on the cubic grid over the training box, in memory that grows with what is evaluated, not with the grid.

The grid has `resolution` points along each axis, the first and the last on the box's faces, so `resolution - 1` cells.
Points and cells are addressed by their integer coordinates (a cell by its lowest corner) and kept in bricks of
`side`^3, made where they are first needed. The coarse lattice of every `stride`-th point, and the last, is evaluated
in full: 24 to 48 lines along an axis for the usual resolutions, so that its spacing hardly depends on them.
"""

import logging
from collections.abc import Callable
from itertools import product

import numpy as np
from jaxtyping import Bool, Float, Float32, Int
from numpy import ndarray

from jointsdf.values import BOX

log = logging.getLogger(__name__)

UNKNOWN = np.float32(np.inf)
OUTSIDE = np.float32(1.0)  # for values that are not finite
CORNERS = np.array(list(product((0, 1), repeat=3)))  # of a unit cell
LATTICE_BLOCKS = 23  # at least so many along an axis, where the stride can be so small
STRIDES = (4, 8, 16, 32)
LARGEST_SIDE = 8  # of a brick

Sdf = Callable[[Float[ndarray, "n 3"]], Float[ndarray, " n"]]


class Grid:
    """The field at the points of the cubic grid, each that is kept evaluated once.

    Args:
        sdf: float32 points of the network frame -> signed distance, negative inside.
        resolution: Points along each axis.
        chunk: Most points in one call of the field.

    Attributes:
        stride: Side of the coarse lattice's blocks, in cells.
        side: Side of a brick, in cells; a divisor of the stride.
        spacing: Distance between neighbouring points, network length units.
        lines: Grid coordinate of each line of the coarse lattice.
        lattice: sdf at the points of the coarse lattice.
        calls: Number of points at which the field was evaluated.
    """

    def __init__(self, sdf: Sdf, resolution: int, chunk: int) -> None:
        self.last = resolution - 1
        self.stride = max(size for size in STRIDES if size == STRIDES[0] or size * LATTICE_BLOCKS <= self.last)
        self.side = min(self.stride, LARGEST_SIDE)
        self.spacing = 2 * BOX / self.last
        self.calls = 0
        self._sdf, self._chunk = sdf, chunk
        self._axis = np.linspace(-BOX, BOX, resolution).astype(np.float32)
        self.lines = np.append(np.arange(0, self.last, self.stride), self.last)
        self.bricks = np.full((self.last // self.side + 1,) * 3, -1)  # row of each brick in the three below
        self._places = np.zeros((0, 3), dtype=np.int64)
        self.values = np.zeros((0, self.side**3), dtype=np.float32)
        self.cells = np.zeros((0, self.side**3), dtype=bool)
        points = self.lines[np.indices((len(self.lines),) * 3).reshape(3, -1).T]
        self.lattice = self.sample(points).reshape((len(self.lines),) * 3)

    def sample(self, points: Int[ndarray, "n 3"]) -> Float32[ndarray, " n"]:
        """Evaluate the field at grid points, and keep nothing."""
        values = np.zeros(len(points), dtype=np.float32)
        for start in range(0, len(points), self._chunk):
            part = slice(start, start + self._chunk)
            values[part] = self._sdf(self._axis[points[part]])
        self.calls += len(points)
        if not np.isfinite(values).all():
            log.warning("the field is not finite at some grid points: they count as outside")
            values[~np.isfinite(values)] = OUTSIDE
        return values

    def evaluate(self, points: Int[ndarray, "n 3"]) -> Float32[ndarray, " n"]:
        """Values at grid points; those that are not known yet are evaluated, and kept."""
        self._make_bricks(points // self.side)
        asked, values = self._where(points), self.values.reshape(-1)
        where = asked[values[asked] == UNKNOWN]
        order, owners = np.arange(len(where), dtype=np.int32), values.view(np.int32)
        owners[where] = order  # of a point that is there several times, one writer is left: faster than sorting
        where = where[owners[where] == order]
        values[where] = self.sample(self._points(where))
        return values[asked]

    def evaluate_all(self) -> None:
        """Evaluate the field at every grid point, and let every cell take part in the surface."""
        plane = np.indices((1, self.last + 1, self.last + 1)).reshape(3, -1).T.copy()
        for x in range(self.last + 1):
            plane[:, 0] = x
            self.evaluate(plane)
            self.add_cells(plane[(plane < self.last).all(axis=1)])

    def at(self, points: Int[ndarray, "*n 3"]) -> Float32[ndarray, "*n"]:
        """Values at evaluated grid points."""
        return self.values.reshape(-1)[self._where(points)]

    def corner_values(self, blocks: Int[ndarray, "n 3"], stride: int) -> Float32[ndarray, "n 8"]:
        """Values at the corners of blocks of `stride`^3 cells, given in units of the stride."""
        if stride == self.stride:
            x, y, z = np.moveaxis(blocks[:, None] + CORNERS, -1, 0)
            return self.lattice[x, y, z]
        return self.at(np.minimum((blocks[:, None] + CORNERS) * stride, self.last))

    def add_cells(self, cells: Int[ndarray, "n 3"]) -> None:
        """Let cells, all of whose corners are evaluated, take part in the surface."""
        self.cells.reshape(-1)[self._where(cells)] = True

    def all_cells(self) -> Int[ndarray, "n 3"]:
        """The cells that take part in the surface."""
        return self._points(np.flatnonzero(self.cells))

    def has_cells(self, cells: Int[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        """Which of the cells take part in the surface."""
        made = self.bricks[tuple((cells // self.side).T)] >= 0
        made[made] = self.cells.reshape(-1)[self._where(cells[made])]
        return made

    def _where(self, points: Int[ndarray, "*n 3"]) -> Int[ndarray, "*n"]:
        """Index of each grid point in the flat `values` and `cells`; its brick must be made."""
        x, y, z = points[..., 0], points[..., 1], points[..., 2]
        side = self.side
        row = self.bricks[x // side, y // side, z // side]
        return ((row * side + x % side) * side + y % side) * side + z % side

    def _points(self, where: Int[ndarray, " n"]) -> Int[ndarray, "n 3"]:
        """The grid points, or cells, at the given indices of the flat `values` and `cells`."""
        row, place = np.divmod(where, self.side**3)
        return self._places[row] * self.side + np.stack(np.unravel_index(place, (self.side,) * 3), axis=1)

    def _make_bricks(self, places: Int[ndarray, "n 3"]) -> None:
        missing = np.ravel_multi_index(tuple(places.T), self.bricks.shape)
        missing = np.unique(missing[self.bricks.reshape(-1)[missing] < 0])
        if not len(missing):
            return
        new = np.stack(np.unravel_index(missing, self.bricks.shape), axis=1)
        used = len(self._places)
        self.bricks[tuple(new.T)] = used + np.arange(len(new))
        self._places = np.concatenate([self._places, new])
        if len(self._places) > len(self.values):  # a quarter more than needed: not copied for every few bricks
            shape = (len(self._places) * 5 // 4 - len(self.values) + 1, self.side**3)
            self.values = np.concatenate([self.values, np.full(shape, UNKNOWN)])
            self.cells = np.concatenate([self.cells, np.zeros(shape, dtype=bool)])
        first = np.searchsorted(self.lines // self.side, new)  # the first line of the lattice in each, along each axis
        for corner in CORNERS:  # what the lattice knows of them
            line = np.minimum(first + corner, len(self.lines) - 1)
            points = self.lines[line]
            own = (points // self.side == new).all(axis=1)
            self.values.reshape(-1)[self._where(points[own])] = self.lattice[tuple(line[own].T)]
