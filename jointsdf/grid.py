"""A field on the cubic grid over the training box, and the cells of that grid that its zero level set passes through.

The grid has `resolution` points along each axis, the first and the last on the box's faces, so `resolution - 1` cells.
`cells_near_surface` evaluates every fourth point, then only the blocks of cells that the surface can reach if the field
is nowhere steeper than the coarse grid suggests, then every block into which the surface found so far continues. So
each connected component that is touched at all is complete.
Not covered: a closed component smaller than a block, where the field is far steeper than around it.
"""

import logging
from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.ndimage import maximum_filter

from jointsdf.values import BOX

log = logging.getLogger(__name__)

STRIDES = (4, 2)  # points between the lines of each coarse grid, in grid points
SAFETY = 1.25  # on the steepest slope seen between coarse grid points: a sample, not a bound
# Mean distance from a corner of the unit cube to its eight corners, the largest such mean over the cube's points.
MEAN_REACH = (3 + 3 * np.sqrt(2) + np.sqrt(3)) / 8

Sdf = Callable[[Float[ndarray, "n 3"]], Float[ndarray, " n"]]


class Grid:
    """The field at the points of the cubic grid, each evaluated at most once.

    Attributes:
        values: sdf, 1 where it is not known.
        known: Where it was evaluated.
        spacing: Distance between neighbouring points, network length units.
    """

    def __init__(self, sdf: Sdf, resolution: int, chunk: int) -> None:
        self.values = np.ones((resolution,) * 3, dtype=np.float32)
        self.known = np.zeros((resolution,) * 3, dtype=bool)
        self.spacing = 2 * BOX / (resolution - 1)
        self._sdf, self._chunk = sdf, chunk
        self._axis = np.linspace(-BOX, BOX, resolution).astype(np.float32)

    def lines(self, stride: int) -> Int[ndarray, " m"]:
        """Indices of every `stride`-th grid point along an axis, and of the last."""
        last = len(self._axis) - 1
        return np.append(np.arange(0, last, stride), last)

    def evaluate(self, cells: Bool[ndarray, "c c c"]) -> None:
        """Evaluate the corners of the given cells that are not known yet."""
        self._evaluate(_reduce_pairs(np.logical_or, np.pad(cells, 1), (0, 1, 2)))

    def evaluate_lattice(self, stride: int, blocks: Bool[ndarray, "b b b"]) -> None:
        """Evaluate the corners of the given blocks of `stride`^3 cells that are not known yet."""
        lines = self.lines(stride)
        wanted = np.zeros_like(self.known)
        wanted[np.ix_(lines, lines, lines)] = _reduce_pairs(np.logical_or, np.pad(blocks, 1), (0, 1, 2))
        self._evaluate(wanted)

    def _evaluate(self, wanted: Bool[ndarray, "r r r"]) -> None:
        where = np.flatnonzero(wanted & ~self.known)
        values, shape = self.values.reshape(-1), self.values.shape
        for start in range(0, len(where), self._chunk):
            part = where[start : start + self._chunk]
            values[part] = self._sdf(self._axis[np.stack(np.unravel_index(part, shape), axis=1)])
        self.known.reshape(-1)[where] = True
        if not np.isfinite(values[where]).all():
            log.warning("the field is not finite at some grid points: they count as outside")
            np.nan_to_num(self.values, copy=False, nan=1.0, posinf=1.0, neginf=1.0)


def cells_near_surface(grid: Grid) -> Bool[ndarray, "c c c"]:
    """Cells that hold the whole zero level set; all their corners are evaluated on return."""
    coarse = STRIDES[0]
    blocks = np.ones((len(grid.lines(coarse)) - 1,) * 3, dtype=bool)
    grid.evaluate_lattice(coarse, blocks)
    steepest = _steepest_slope(grid, coarse)
    parent = coarse
    for stride in STRIDES:
        within = np.ix_(*[grid.lines(stride)[:-1] // parent] * 3)
        blocks, steepest, parent = blocks[within], steepest[within], stride
        grid.evaluate_lattice(stride, blocks)
        blocks &= _reachable(grid, stride, steepest)
    cell = np.arange(len(grid.values) - 1)
    cells = blocks[np.ix_(*[cell // parent] * 3)]
    grid.evaluate(cells)
    while (escaped := _escapes(grid.values, cells)).any():
        coarser = np.zeros((len(grid.lines(coarse)) - 1,) * 3, dtype=bool)
        coarser[tuple(index // coarse for index in np.nonzero(escaped))] = True
        cells |= coarser[np.ix_(*[cell // coarse] * 3)]
        grid.evaluate(cells)
    return cells


def _steepest_slope(grid: Grid, stride: int) -> Float[ndarray, "b b b"]:
    """Steepest slope to be expected in each block: the largest around it, and at least the grid's median."""
    lines = grid.lines(stride)
    values = grid.values[np.ix_(lines, lines, lines)].astype(np.float64)
    squared = np.zeros((len(lines) - 1,) * 3)
    for axis in range(3):
        lengths = np.expand_dims(np.diff(lines) * grid.spacing, [other for other in range(3) if other != axis])
        slopes = np.abs(np.diff(values, axis=axis)) / lengths
        squared += _reduce_pairs(np.maximum, slopes, [other for other in range(3) if other != axis]) ** 2
    slopes = np.sqrt(squared)
    return SAFETY * np.maximum(maximum_filter(slopes, size=3), np.median(slopes))


def _reachable(grid: Grid, stride: int, steepest: Float[ndarray, "b b b"]) -> Bool[ndarray, "b b b"]:
    """Blocks that may hold a zero: |f| at a corner is at most the slope times the corner's distance to the zero."""
    lines = grid.lines(stride)
    values = grid.values[np.ix_(lines, lines, lines)]
    mean = _reduce_pairs(np.add, np.abs(values), (0, 1, 2)) / 8
    return (mean <= steepest * MEAN_REACH * stride * grid.spacing) | mixed(values, (0, 1, 2))


def _escapes(values: Float[ndarray, "r r r"], cells: Bool[ndarray, "c c c"]) -> Bool[ndarray, "c c c"]:
    """Cells outside the given ones that the surface enters from them, through a shared face."""
    entered = np.zeros_like(cells)
    for axis in range(3):
        inner = [slice(None)] * 3
        inner[axis] = slice(1, -1)
        crossed = mixed(values[tuple(inner)], [other for other in range(3) if other != axis])
        crossing = crossed & np.diff(cells, axis=axis)
        for side in (slice(None, -1), slice(1, None)):
            inner[axis] = side
            entered[tuple(inner)] |= crossing
    return entered & ~cells


def mixed(values: Float[ndarray, "x y z"], axes: Sequence[int]) -> Bool[ndarray, "x2 y2 z2"]:
    """Whether the corners of each cell (three axes) or face (two) lie on both sides; a zero lies on both."""
    positive, negative = values > 0, values < 0
    return ~(_reduce_pairs(np.logical_and, positive, axes) | _reduce_pairs(np.logical_and, negative, axes))


def _reduce_pairs(ufunc: np.ufunc, array: ndarray, axes: Sequence[int]) -> ndarray:
    """Combine each entry with the next along each of the axes; every such axis gets one shorter."""
    for axis in axes:
        lower, upper = [slice(None)] * 3, [slice(None)] * 3
        lower[axis], upper[axis] = slice(None, -1), slice(1, None)
        array = ufunc(array[tuple(lower)], array[tuple(upper)])
    return array
