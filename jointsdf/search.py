"""The cells of a grid that the zero level set of a field passes through, without evaluating the field elsewhere.

Blocks are halved, from those of the coarse lattice down to single cells, and an octant is skipped, without evaluating
anything of it, if no zero can be within it. That is told from the values at the corners of its block alone, in one of
two ways:
    while the field is nowhere steeper than a bound, a guess: 1.25 times the steepest slope between points of the coarse
    lattice around, and at least that of the median block;
    while the field is nowhere farther from what is interpolated between those corners than it was at the corners
    themselves, when the block was an octant and they were evaluated.
Every guess is checked: in each coarse block of which something was skipped, and in a share of the finer ones, the field
is evaluated at a random grid point. Where it is steeper than the bound between that point and a corner, or farther from
the interpolated value than was believed, 1.25 times what was seen is believed there and in the coarse blocks around.
What was skipped there is judged and checked anew, until no check fails. Then the surface is followed wherever it leaves
the cells found so far.

Guaranteed, for any field:
    every component of the dense grid's surface that passes through one evaluated cell is complete, so the sparse mesh
    has no hole that the dense mesh has not; and a component is found if a point of the coarse lattice lies within it.
Guaranteed, as far as the field keeps the final bounds: all of the surface.
Not guaranteed: a closed component, all of it in skipped octants, around no lattice point, and so small and steep that
no random point meets its flanks. The chance of missing one is the product, over the coarse blocks that it reaches
into, of the share of each block's grid points that keep the bound; of what is skipped within finer blocks, one octant
in 32 is asked.
"""

import logging
from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.ndimage import maximum_filter

from jointsdf.grid import CORNERS, Grid

log = logging.getLogger(__name__)

SAFETY = 1.25  # on the steepest slope, and the largest distance from interpolation, seen: to bound those not seen
ROUNDING = np.float32(1e-6)  # of the field's float32: smaller distances from interpolation tell nothing
CHECKED = 0.25  # share of the halved blocks finer than the coarse lattice's that are checked
FOLLOWED = 4  # cells along an edge of the blocks that are added where the surface leaves the cells found
BATCH = 1 << 14  # blocks halved at once
ACROSS = ((1, 2), (0, 2), (0, 1))  # the other two axes
THIRDS = np.array(list(product((0, 1, 2), repeat=3)))  # a block's points at half its stride
OF_OCTANT = (CORNERS[:, None] + CORNERS) @ np.array([9, 3, 1])  # which of them are the corners of each octant
# Largest distance of a corner of the unit cube (second axis) to a point of its octant (first axis).
REACH = np.sqrt(np.array([0.75, 1.5, 2.25, 3], dtype=np.float32))[np.abs(CORNERS[:, None] - CORNERS[None]).sum(axis=-1)]

Blocks = Int[ndarray, "_ 3"]  # of some stride: in units of that stride
Octants = Bool[ndarray, "_ 8"]  # of each block, in the order of `CORNERS`


class Halved(NamedTuple):
    """Blocks of one stride, corners evaluated, whose octants are in question.

    Attributes:
        blocks: In units of the stride.
        bends: Distance of the field from what is interpolated that was found at their corners, network length units;
            infinite: not known.
        octants: Before they are judged, those to be judged; afterwards those that are skipped.
        bent: Those skipped for the bend's sake alone.
    """

    blocks: Blocks
    bends: Float[ndarray, " _"]
    octants: Octants
    bent: Octants


class Believed(NamedTuple):
    """What bounds the field in each coarse block; or what was seen there.

    Attributes:
        slopes: Steepest slope, dimensionless.
        bends: Largest distance from what is interpolated, in units of a block's `Halved.bends`.
    """

    slopes: Float[ndarray, "b b b"]
    bends: Float[ndarray, "b b b"]


NONE = Halved(np.zeros((0, 3), dtype=np.int64), np.zeros(0, dtype=np.float32), *np.zeros((2, 0, 8), dtype=bool))


def cells_near_surface(grid: Grid) -> None:
    """Add to the grid every cell that the zero level set passes through, corners evaluated."""
    rng = np.random.default_rng(0)
    slopes = _lattice_slopes(grid)
    believed = Believed(slopes, np.ones_like(slopes))
    strides = [grid.stride >> level for level in range(grid.stride.bit_length() - 1)]  # ..., 4, 2
    skipped = {stride: NONE for stride in strides}
    lattice = np.indices(slopes.shape).reshape(3, -1).T
    waiting = skipped | {grid.stride: _whole(grid, lattice, np.full(len(lattice), np.inf), grid.stride)}
    while any(len(halved.blocks) for halved in waiting.values()):
        fresh = _refine(grid, believed, waiting)
        believed, changed = _corrected(believed, _check(grid, fresh, rng))
        for stride in strides:
            known = _joined([skipped[stride], fresh[stride]])
            anew = changed[_coarse(grid, known.blocks, stride)]
            waiting[stride], skipped[stride] = _rows(known, anew), _rows(known, ~anew)
    _follow(grid)


def _whole(grid: Grid, blocks: Blocks, bends: Float[ndarray, " n"], stride: int) -> Halved:
    """Blocks with all their octants in question, but for those beyond the grid's last point."""
    octants = ((2 * blocks[:, None] + CORNERS) * (stride // 2) < grid.last).all(axis=2)
    return Halved(blocks, bends.astype(np.float32), octants, np.zeros_like(octants))


def _corrected(believed: Believed, seen: Believed) -> tuple[Believed, Bool[ndarray, "b b b"]]:
    """What is believed after a check: more, where more was seen and around; and where that is."""
    raised, failed = [], np.zeros(seen.slopes.shape, dtype=bool)
    for bound, found in zip(believed, seen, strict=True):
        failed |= found > bound
        raised.append(np.maximum(bound, maximum_filter(np.where(found > bound, SAFETY * found, 0), size=3)))
    if failed.any():
        log.debug("checks failed in %d blocks; slopes now at most %.3g", failed.sum(), raised[0].max())
    return Believed(*raised), maximum_filter(failed, size=3)


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


def _refine(grid: Grid, believed: Believed, waiting: dict[int, Halved]) -> dict[int, Halved]:
    """Halve blocks until their octants can be skipped or are single cells; what was skipped, by the blocks' stride."""
    skipped, reached = {}, NONE
    for stride, blocks in waiting.items():
        parts = [_judge(grid, believed, part, stride) for part in _parts(_joined([blocks, reached]))]
        skipped[stride] = _joined([outside for _, outside in parts])
        reached = _joined([within for within, _ in parts])
    return skipped


def _judge(grid: Grid, believed: Believed, halved: Halved, stride: int) -> tuple[Halved, Halved]:
    """The octants that a zero may lie in, as blocks or cells of the grid, corners evaluated; and the skipped ones.

    No zero is in an octant that a corner of the block rules out by the slope, or whose own corners, interpolated, are
    all farther from 0 than the bend, and on one side.
    """
    blocks, bends, octants, _ = halved
    values, coarse = grid.corner_values(blocks, stride), _coarse(grid, blocks, stride)
    allowed = (np.abs(values)[:, None] / REACH).max(axis=2) / np.float32(stride * grid.spacing)
    sloped = allowed > believed.slopes[coarse][:, None]
    interpolated = values @ _weights(THIRDS / 2).T
    least, most = _over_octants(np.minimum, interpolated), _over_octants(np.maximum, interpolated)
    bent = ~sloped & (np.maximum(least, -most) > (believed.bends[coarse] * bends)[:, None])
    reached = octants & ~(sloped | bent)
    skipped = octants & (sloped | bent)
    outside = _rows(Halved(blocks, bends, skipped, skipped & bent), skipped.any(axis=1))
    halves, half = (2 * blocks[:, None] + CORNERS)[reached], stride // 2
    points = np.minimum((halves[:, None] + CORNERS) * half, grid.last)
    found = grid.evaluate(points.reshape(-1, 3)).reshape(-1, len(CORNERS))
    if half == 1:
        grid.add_cells(halves)
        return NONE, outside
    away = np.abs(found - interpolated[:, OF_OCTANT][reached]).max(axis=1)
    return _whole(grid, halves, np.maximum(away, ROUNDING), half), outside


def _over_octants(extreme: np.ufunc, values: Float[ndarray, "n 27"]) -> Float[ndarray, "n 8"]:
    """The least or the most of the values at each octant's corners."""
    cube = values.reshape(-1, 3, 3, 3)
    cube = extreme(cube[:, :-1], cube[:, 1:])
    cube = extreme(cube[:, :, :-1], cube[:, :, 1:])
    return np.asarray(extreme(cube[..., :-1], cube[..., 1:]).reshape(-1, 8))


def _check(grid: Grid, skipped: dict[int, Halved], rng: np.random.Generator) -> Believed:
    """What is seen of the field in each coarse block, at a random grid point of blocks there; 0 without.

    Of each block one octant is asked for, if it was skipped.
    """
    seen = Believed(*np.zeros((2, *[len(grid.lines) - 1] * 3)))
    for stride, halved in skipped.items():
        one = np.eye(len(CORNERS), dtype=bool)[rng.integers(len(CORNERS), size=len(halved.blocks))]
        share = CHECKED if stride < grid.stride else 1
        asked = halved._replace(octants=one & halved.octants & (rng.random((len(one), 1)) < share))
        for blocks, bends, octant, by_bend in _parts(_rows(asked, np.any(asked.octants, axis=1))):
            inside = CORNERS[octant.argmax(axis=1)] * (stride // 2) + rng.integers(0, stride // 2 + 1, blocks.shape)
            inside[(inside % stride == 0).all(axis=1)] = stride // 2  # no corner
            points = np.minimum(blocks * stride + inside, grid.last)
            corners = np.minimum((blocks[:, None] + CORNERS) * stride, grid.last)
            apart = grid.spacing * np.linalg.norm(corners - points[:, None], axis=2)
            values, coarse = grid.corner_values(blocks, stride), _coarse(grid, blocks, stride)
            found = grid.sample(points) if stride == grid.stride else grid.evaluate(points)  # kept near the surface
            rise = np.abs(values - found[:, None])
            slopes = np.divide(rise, apart, out=np.zeros_like(apart), where=apart > 0).max(axis=1)
            np.maximum.at(seen.slopes, coarse, slopes)
            away = np.abs(found - (_weights(inside / stride) * values).sum(axis=1))
            np.maximum.at(seen.bends, coarse, np.where((by_bend & octant).any(axis=1), away / bends, 0))
    return seen


def _coarse(grid: Grid, blocks: Blocks, stride: int) -> tuple[Int[ndarray, " n"], ...]:
    """Index of the coarse block around each."""
    return tuple((blocks * stride // grid.stride).T)


def _weights(inside: Float[ndarray, "n 3"]) -> Float[ndarray, "n 8"]:
    """What each corner of the unit cube counts in the trilinear interpolation at points of it."""
    return np.asarray(np.where(CORNERS, inside[:, None], 1 - inside[:, None]).prod(axis=-1))


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


def _parts(halved: Halved) -> Iterator[Halved]:
    for start in range(0, len(halved.blocks), BATCH):
        yield Halved(*(column[start : start + BATCH] for column in halved))


def _rows(halved: Halved, chosen: Bool[ndarray, " n"]) -> Halved:
    return Halved(*(column[chosen] for column in halved))


def _joined(parts: list[Halved]) -> Halved:
    return Halved(*(np.concatenate(columns) for columns in zip(NONE, *parts, strict=True)))
