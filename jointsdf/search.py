"""The cells of a grid that the zero level set of a field passes through, without evaluating the field elsewhere.

A block of cells is skipped if no zero can be within it while the field is nowhere steeper than a bound, from the
values at its corners alone. The bound is a guess (1.25 times the steepest slope between points of the coarse lattice
around, and at least that of the median block), and every guess is checked: in each coarse block that was skipped, and
in a share of the finer ones, the field is evaluated at a random grid point. Where it is steeper than the bound between
that point and a corner (a sign that differs always is), the bound is raised there and in the blocks around, what was
skipped there is judged and checked anew, until no check fails. Then the surface is followed wherever it leaves the
cells found so far.

Guaranteed, for any field:
    every component of the dense grid's surface that passes through one evaluated cell is complete, so the sparse mesh
    has no hole that the dense mesh has not; and a component is found if a point of the coarse lattice lies within it.
Guaranteed, as far as the field keeps the final bounds: all of the surface.
Not guaranteed: a closed component, all of it in skipped blocks, around no lattice point, and so small and steep that
no random point meets its flanks. The chance of missing one is the product, over the coarse blocks that it reaches
into, of the share of each block's grid points that keep the bound.
"""

import logging
from collections.abc import Iterator
from itertools import product

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.ndimage import maximum_filter

from jointsdf.grid import CORNERS, Grid

log = logging.getLogger(__name__)

SAFETY = 1.25  # on the steepest slope seen, to bound those not seen
CHECKED = 0.25  # share of the skipped blocks finer than the coarse lattice's that are checked
FOLLOWED = 4  # cells along an edge of the blocks that are added where the surface leaves the cells found
BATCH = 1 << 17  # blocks handled at once
ACROSS = ((1, 2), (0, 2), (0, 1))  # the other two axes
THIRDS = np.array(list(product((0, 1, 2), repeat=3)))  # a block's points at half its stride
# Largest distance of a corner of the unit cube (second axis) to a point of its octant (first axis).
REACH = np.sqrt(np.array([0.75, 1.5, 2.25, 3.0]))[np.abs(CORNERS[:, None] - CORNERS[None]).sum(axis=-1)]

Blocks = Int[ndarray, "_ 3"]  # of some stride: in units of that stride


def cells_near_surface(grid: Grid) -> None:
    """Add to the grid every cell that the zero level set passes through, corners evaluated."""
    rng = np.random.default_rng(0)
    bounds = _lattice_slopes(grid)
    strides = [grid.stride >> level for level in range(grid.stride.bit_length() - 1)]  # ..., 4, 2
    skipped = {stride: np.zeros((0, 3), dtype=np.int64) for stride in strides}
    waiting = skipped | {grid.stride: np.indices(bounds.shape).reshape(3, -1).T}
    while any(map(len, waiting.values())):
        fresh = _refine(grid, bounds, waiting)
        steepest = _check(grid, fresh, rng, bounds.shape)
        refuted = steepest > bounds
        bounds = np.maximum(bounds, maximum_filter(np.where(refuted, SAFETY * steepest, 0), size=3))
        raised = maximum_filter(refuted, size=3)
        for stride in strides:
            skipped[stride] = np.concatenate([skipped[stride], fresh[stride]])
            anew = raised[tuple((skipped[stride] * stride // grid.stride).T)]
            waiting[stride], skipped[stride] = skipped[stride][anew], skipped[stride][~anew]
        if refuted.any():
            log.debug("slope bound raised to at most %.3g in %d blocks", bounds.max(), refuted.sum())
    _follow(grid)


def _lattice_slopes(grid: Grid) -> Float[ndarray, "b b b"]:
    """A bound on the slope in each coarse block, by the lattice points of the block and those around it."""
    lengths, blocks = np.diff(grid.lines) * grid.spacing, len(grid.lines) - 1
    rises = [np.diff(grid.lattice.astype(np.float64), axis=axis) for axis in range(3)]
    squared = [(rise / np.expand_dims(lengths, rest)) ** 2 for rise, rest in zip(rises, ACROSS, strict=True)]
    slopes = np.zeros((blocks,) * 3)
    for corner in CORNERS:  # of a block: its three edges there
        edges = np.zeros((blocks,) * 3)
        for axis, along in enumerate(squared):
            edges += along[
                tuple(slice(side, side + blocks) if i != axis else slice(None) for i, side in enumerate(corner))
            ]
        slopes = np.maximum(slopes, np.sqrt(edges))
    return SAFETY * np.maximum(maximum_filter(slopes, size=3), np.median(slopes))


def _refine(grid: Grid, bounds: Float[ndarray, "b b b"], waiting: dict[int, Blocks]) -> dict[int, Blocks]:
    """Halve the waiting blocks until they can be skipped or are single cells; the skipped ones by stride."""
    skipped, halves = {}, np.zeros((0, 3), dtype=np.int64)
    for stride, blocks in waiting.items():
        blocks = np.concatenate([blocks, halves])
        reached = np.concatenate(
            [np.zeros(0, dtype=bool), *(_reached(grid, bounds, b, stride) for b in _batches(blocks))]
        )
        skipped[stride] = blocks[~reached]
        halves = np.concatenate([halves[:0], *(_halve(grid, b, stride) for b in _batches(blocks[reached]))])
    grid.add_cells(halves)
    return skipped


def _reached(grid: Grid, bounds: Float[ndarray, "b b b"], blocks: Blocks, stride: int) -> Bool[ndarray, " _"]:
    """Which blocks a zero may lie in. None does where the corners rule out each octant, all with one sign."""
    values = grid.corner_values(blocks, stride)
    one_sign = (values > 0).all(axis=1) | (values < 0).all(axis=1)
    sizes = np.abs(values)
    allowed = np.min([(sizes / reach).max(axis=1) for reach in REACH], axis=0) / (stride * grid.spacing)
    return ~one_sign | (allowed <= bounds[tuple((blocks * stride // grid.stride).T)])


def _halve(grid: Grid, blocks: Blocks, stride: int) -> Blocks:
    """The eight blocks of half the stride in each, corners evaluated; without those beyond the grid's last point."""
    half = stride // 2
    points = np.minimum((2 * blocks[:, None] + THIRDS) * half, grid.last)
    grid.evaluate(points.reshape(-1, 3))
    halves = (2 * blocks[:, None] + CORNERS).reshape(-1, 3)
    return halves[(halves * half < grid.last).all(axis=1)]


def _check(
    grid: Grid, skipped: dict[int, Blocks], rng: np.random.Generator, shape: tuple[int, ...]
) -> Float[ndarray, "b b b"]:
    """Steepest slope between a random grid point of each checked block and its corners, by coarse block; 0 without."""
    steepest = np.zeros(shape)
    for stride, blocks in skipped.items():
        if stride < grid.stride:
            blocks = blocks[rng.random(len(blocks)) < CHECKED]
        for batch in _batches(blocks):
            inside = rng.integers(0, stride + 1, batch.shape)
            inside[(inside % stride == 0).all(axis=1), 0] = stride // 2  # no corner
            points = np.minimum(batch * stride + inside, grid.last)
            corners = np.minimum((batch[:, None] + CORNERS) * stride, grid.last)
            apart = grid.spacing * np.linalg.norm(corners - points[:, None], axis=2)
            rise = np.abs(grid.corner_values(batch, stride) - grid.sample(points)[:, None])
            slopes = np.divide(rise, apart, out=np.zeros_like(apart), where=apart > 0).max(axis=1)
            np.maximum.at(steepest, tuple((batch * stride // grid.stride).T), slopes)
    return steepest


def _follow(grid: Grid) -> None:
    """Add the whole block of `FOLLOWED`^3 cells around every cell that the surface enters from those found so far."""
    points, inside = (np.indices((FOLLOWED + more,) * 3).reshape(3, -1).T for more in (1, 0))
    cells = grid.all_cells()
    while len(cells):
        entered = np.unique(np.concatenate([_entered(grid, batch) for batch in _batches(cells)]), axis=0)
        added = [entered[:0]]
        for batch in _batches(entered, BATCH // len(points)):
            grid.evaluate(np.minimum(batch[:, None] * FOLLOWED + points, grid.last).reshape(-1, 3))
            around = (batch[:, None] * FOLLOWED + inside).reshape(-1, 3)
            around = around[(around < grid.last).all(axis=1)]
            added.append(around[~grid.has_cells(around)])
            grid.add_cells(added[-1])
        cells = np.concatenate(added)


def _entered(grid: Grid, cells: Blocks) -> Blocks:
    """Blocks of the cells that are not found yet and share a face with the given ones that the surface cuts."""
    values = grid.corner_values(cells, 1)
    cut = mixed(values)
    cells, values = cells[cut], values[cut]
    blocks = [np.zeros((0, 3), dtype=np.int64)]
    for axis, side in product(range(3), (0, 1)):
        across = cells[mixed(values[:, CORNERS[:, axis] == side])] + (2 * side - 1) * np.eye(3, dtype=np.int64)[axis]
        across = across[((across >= 0) & (across < grid.last)).all(axis=1)]
        blocks.append(across[~grid.has_cells(across)] // FOLLOWED)
    return np.concatenate(blocks)


def mixed(values: Float[ndarray, "n c"]) -> Bool[ndarray, " n"]:
    """Whether the corners of each cell or face lie on both sides; a zero lies on both."""
    return np.logical_not((values > 0).all(axis=1) | (values < 0).all(axis=1))


def _batches(blocks: Blocks, size: int = BATCH) -> Iterator[Blocks]:
    for start in range(0, len(blocks), size):
        yield blocks[start : start + size]
