"""Sparse grid over the training box: values in bricks, so that memory grows with what is evaluated, not with the grid.

The grid has `resolution` points along each axis, the first and the last on the box's faces, so `resolution - 1` cells.
Points and cells are addressed by their integer coordinates (a cell by its lowest corner) and stored in bricks of
`side`^3, allocated where they are first needed. The coarse lattice of every `stride`-th point, and the last, is
evaluated in full: 24 to 48 lines along an axis for the usual resolutions, so its spacing hardly depends on them.
"""

import logging
from collections.abc import Callable
from itertools import product

import numpy as np
from jaxtyping import Bool, Float, Float32, Int
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.values import BOX

log = logging.getLogger(__name__)

UNKNOWN = np.float32(np.inf)  # value of a stored point that is not evaluated
NOT_FINITE = np.float32(1.0)  # stands for values that are not finite: outside
CORNERS = np.array(list(product((0, 1), repeat=3)))  # of a unit cell
LATTICE_BLOCKS = 23  # fewest blocks of the coarse lattice along an axis, where the smallest stride allows it
STRIDES = (4, 8, 16, 32)  # cells along a block of the coarse lattice
LARGEST_SIDE = 8  # cells along a brick
GROWTH = (5, 4)  # memory allocated per memory needed: a quarter more, so that it is not copied for every few bricks

MOST_EVALUATED = 1 << 26  # points: five times those of the largest shapes on the finest grid, five minutes on two cores

Sdf = Callable[[Float[ndarray, "n 3"]], Float[ndarray, " n"]]
Points = Int[ndarray, "_ 3"]  # of the grid; cells are addressed by their lowest corner
NO_POINTS: Points = np.zeros((0, 3), dtype=np.int64)


class TooLarge(InputError):
    """The surface is larger than the extraction holds: it fills the box, as that of noise does."""

    def __init__(self, resolution: int, found: str) -> None:
        fix = "give a smaller extraction.resolution"
        super().__init__(f"{resolution}^3: {found}: the field's surface fills the box, as noise does; {fix}")


class Grid:
    """Values of a field on the cubic grid; a stored point is evaluated once.

    Args:
        sdf: float32 points of the network frame -> signed distance, negative inside.
        resolution: Points along each axis.
        chunk: Most points in one call of the field.
        most: Points that may be evaluated, `TooLarge` is raised before more are; None for any number.

    Attributes:
        last: Coordinate of the last point along an axis; the number of cells along it.
        stride: Side of the coarse lattice's blocks, in cells.
        side: Side of a brick, in cells; a divisor of the stride.
        spacing: Distance between neighbouring points, network length units.
        lines: Grid coordinate of each line of the coarse lattice.
        lattice: sdf at the points of the coarse lattice.
        bricks: Row of each brick in `values` and `active`; -1 where it is not allocated.
        values: sdf at the points of each allocated brick; `UNKNOWN` where it is not evaluated.
        active: Marks the cells of each allocated brick that take part in the surface.
        evaluations: Number of points at which the field was evaluated.

    >>> grid = Grid(lambda points: points[:, 2], resolution=9, chunk=100)
    >>> grid.evaluate(np.array([[0, 0, 0], [8, 8, 8], [0, 0, 0]])).round(2)
    array([-1.1,  1.1, -1.1], dtype=float32)
    """

    def __init__(self, sdf: Sdf, resolution: int, chunk: int, most: int | None = None) -> None:
        self.last = resolution - 1
        self.stride = max(size for size in STRIDES if size == STRIDES[0] or size * LATTICE_BLOCKS <= self.last)
        self.side = min(self.stride, LARGEST_SIDE)
        self.spacing = 2 * BOX / self.last
        self.evaluations = 0
        self._sdf, self._chunk, self._most = sdf, chunk, most
        self._axis = np.linspace(-BOX, BOX, resolution).astype(np.float32)
        self.lines = np.append(np.arange(0, self.last, self.stride), self.last)
        self.bricks = np.full((self.last // self.side + 1,) * 3, -1)
        self._places = np.zeros((0, 3), dtype=np.int64)  # of each allocated brick, in units of bricks
        self.values = np.zeros((0, self.side**3), dtype=np.float32)
        self.active = np.zeros((0, self.side**3), dtype=bool)
        points = self.lines[np.indices((len(self.lines),) * 3).reshape(3, -1).T]
        self.lattice = self.sample(points).reshape((len(self.lines),) * 3)

    def sample(self, points: Int[ndarray, "n 3"]) -> Float32[ndarray, " n"]:
        """Evaluate the field at grid points without storing the values."""
        if self._most is not None and self.evaluations + len(points) > self._most:
            raise TooLarge(self.last + 1, f"more than {self._most / 1e6:.0f} million points near it to evaluate")
        values = np.zeros(len(points), dtype=np.float32)
        for start in range(0, len(points), self._chunk):
            part = slice(start, start + self._chunk)
            values[part] = self._sdf(self._axis[points[part]])
        self.evaluations += len(points)
        if not np.isfinite(values).all():
            log.warning("the field is not finite at some grid points: they count as outside")
            values[~np.isfinite(values)] = NOT_FINITE
        return values

    def evaluate(self, points: Int[ndarray, "n 3"]) -> Float32[ndarray, " n"]:
        """Values at grid points; evaluates and stores those that are not known."""
        self._allocate_bricks(points // self.side)
        asked, values = self._indices(points), self.values.reshape(-1)
        unknown = _drop_repeats(asked[values[asked] == UNKNOWN], len(values))
        values[unknown] = self.sample(self._points_at(unknown))
        return values[asked]

    def activate_all(self) -> None:
        """Evaluate the field at every grid point, and let every cell take part in the surface."""
        plane = np.indices((1, self.last + 1, self.last + 1)).reshape(3, -1).T.copy()
        for x in range(self.last + 1):
            plane[:, 0] = x
            self.evaluate(plane)
            self.activate(plane[(plane < self.last).all(axis=1)])

    def corner_values(self, blocks: Int[ndarray, "n 3"], stride: int) -> Float32[ndarray, "n 8"]:
        """Values at the evaluated corners of blocks of `stride`^3 cells, addressed in units of the stride."""
        corners = blocks[:, None] + CORNERS
        if stride == self.stride:
            x, y, z = np.moveaxis(corners, -1, 0)
            return self.lattice[x, y, z]
        return self.values.reshape(-1)[self._indices(np.minimum(corners * stride, self.last))]

    def activate(self, cells: Int[ndarray, "n 3"]) -> None:
        """Let cells, all of whose corners are evaluated, take part in the surface."""
        self.active.reshape(-1)[self._indices(cells)] = True

    def active_cells(self) -> Int[ndarray, "n 3"]:
        """The cells that take part in the surface."""
        return self._points_at(np.flatnonzero(self.active))

    def is_active(self, cells: Int[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        """Mark the cells that take part in the surface."""
        marks = self.bricks[tuple((cells // self.side).T)] >= 0
        marks[marks] = self.active.reshape(-1)[self._indices(cells[marks])]
        return marks

    def _indices(self, points: Int[ndarray, "*n 3"]) -> Int[ndarray, "*n"]:
        """Index of each grid point in the flat `values` and `active`; its brick must be allocated."""
        x, y, z = points[..., 0], points[..., 1], points[..., 2]
        side = self.side
        row = self.bricks[x // side, y // side, z // side]
        return ((row * side + x % side) * side + y % side) * side + z % side

    def _points_at(self, indices: Int[ndarray, " n"]) -> Int[ndarray, "n 3"]:
        """The grid points, or cells, at the given indices of the flat `values` and `active`."""
        row, place = np.divmod(indices, self.side**3)
        return self._places[row] * self.side + np.stack(np.unravel_index(place, (self.side,) * 3), axis=1)

    def _allocate_bricks(self, places: Int[ndarray, "n 3"]) -> None:
        missing = np.ravel_multi_index(tuple(places.T), self.bricks.shape)
        missing = np.unique(missing[self.bricks.reshape(-1)[missing] < 0])
        if not len(missing):
            return
        new = np.stack(np.unravel_index(missing, self.bricks.shape), axis=1)
        self.bricks[tuple(new.T)] = len(self._places) + np.arange(len(new))
        self._places = np.concatenate([self._places, new])
        if len(self._places) > len(self.values):
            shape = (len(self._places) * GROWTH[0] // GROWTH[1] - len(self.values) + 1, self.side**3)
            self.values = np.concatenate([self.values, np.full(shape, UNKNOWN)])
            self.active = np.concatenate([self.active, np.zeros(shape, dtype=bool)])
        self._copy_lattice(new)

    def _copy_lattice(self, places: Int[ndarray, "n 3"]) -> None:
        """Store the lattice's values in new bricks; none holds more than two lattice lines along an axis."""
        first = np.searchsorted(self.lines // self.side, places)  # the first line in each brick, along each axis
        for corner in CORNERS:
            line = np.minimum(first + corner, len(self.lines) - 1)
            points = self.lines[line]
            own = (points // self.side == places).all(axis=1)
            self.values.reshape(-1)[self._indices(points[own])] = self.lattice[tuple(line[own].T)]


def _drop_repeats(indices: Int[ndarray, " n"], size: int) -> Int[ndarray, " u"]:
    """Each index below `size` once, in the given order, at its last place: by scattering, which is faster than sorting.

    >>> _drop_repeats(np.array([5, 2, 5, 7, 2]), 8).tolist()
    [5, 7, 2]
    """
    order = np.arange(len(indices), dtype=np.int32)
    last_place = np.zeros(size, dtype=np.int32)  # zeroed lazily by the system: only pages that are written cost
    last_place[indices] = order
    return indices[last_place[indices] == order]
