"""Which octants of a grid's blocks the zero level set can pass through, told from the values at the blocks' corners."""

from typing import NamedTuple, TypeVar

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.ndimage import maximum_filter

from jointsdf.extraction.sparse_grid import CORNERS, Grid

SAFETY = 1.25  # on the steepest slope, and the largest distance from interpolation, seen: to bound those not seen
ROUNDING = np.float32(1e-6)  # of the field's float32: smaller distances from interpolation tell nothing
ACROSS = ((1, 2), (0, 2), (0, 1))  # the other two axes
OF_OCTANT = (CORNERS[:, None] + CORNERS) @ np.array([9, 3, 1])  # of a block's 27 points at half its stride
# Largest distance of a corner of the unit cube (second axis) to a point of its octant (first axis).
REACH = np.sqrt(np.array([0.75, 1.5, 2.25, 3], dtype=np.float32))[np.abs(CORNERS[:, None] - CORNERS).sum(axis=-1)]

Blocks = Int[ndarray, "_ 3"]  # of some stride: in units of that stride
Octants = Bool[ndarray, "_ 8"]  # of each block, in the order of `CORNERS`


class Halved(NamedTuple):
    """Blocks of one stride, corners evaluated, some of whose octants are to be judged.

    Attributes:
        blocks: In units of the stride.
        bends: Distance of the field from what is interpolated that was found at their corners, network length units;
            infinite: not known.
        octants: Those to be judged.
    """

    blocks: Blocks
    bends: Float[ndarray, " _"]
    octants: Octants


class Skipped(NamedTuple):
    """Blocks of one stride, some of whose octants hold no zero, as far as is believed.

    Attributes:
        blocks: In units of the stride.
        bends: As in `Halved`.
        octants: The skipped ones.
        bent: Those of them that the bend alone rules out.
    """

    blocks: Blocks
    bends: Float[ndarray, " _"]
    octants: Octants
    bent: Octants


Table = TypeVar("Table", Halved, Skipped)


class Believed(NamedTuple):
    """What bounds the field in each coarse block; or what was seen there.

    Attributes:
        slopes: Steepest slope, dimensionless.
        bends: Largest distance from what is interpolated, in units of a block's own bend.
    """

    slopes: Float[ndarray, "b b b"]
    bends: Float[ndarray, "b b b"]


def of_lattice(grid: Grid) -> Believed:
    """What the lattice tells: the slopes between its points, in each block and around it, and in the median block."""
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
    slopes = SAFETY * np.maximum(maximum_filter(slopes, size=3), np.median(slopes))
    return Believed(slopes, np.ones_like(slopes))


def corrected(believed: Believed, seen: Believed) -> tuple[Believed, Bool[ndarray, "b b b"]]:
    """What is believed after a check: more, where more was seen and around; and where that is."""
    raised, failed = [], np.zeros(seen.slopes.shape, dtype=bool)
    for bound, found in zip(believed, seen, strict=True):
        failed |= found > bound
        raised.append(np.maximum(bound, maximum_filter(np.where(found > bound, SAFETY * found, 0), size=3)))
    return Believed(*raised), maximum_filter(failed, size=3)


def halved(grid: Grid, blocks: Blocks, bends: Float[ndarray, " n"], stride: int) -> Halved:
    """Blocks with all their octants to be judged, but for those beyond the grid's last point."""
    octants = ((2 * blocks[:, None] + CORNERS) * (stride // 2) < grid.last).all(axis=2)
    return Halved(blocks, bends.astype(np.float32), octants)


def judged(grid: Grid, believed: Believed, asked: Halved, stride: int) -> tuple[Halved | None, Skipped]:
    """The octants that a zero may lie in, themselves halved, or added to the grid's cells; and the skipped ones.

    No zero is in an octant that a corner of the block rules out by the slope, or whose own corners, interpolated, are
    all farther from 0 than the bend, and on one side.
    """
    blocks, bends, octants = asked
    values, coarse, half = grid.corner_values(blocks, stride), coarse_blocks(grid, blocks, stride), stride // 2
    allowed = (np.abs(values)[:, None] / REACH).max(axis=2) / np.float32(stride * grid.spacing)
    sloped = allowed > believed.slopes[coarse][:, None]
    interpolated = _between_corners(values, np.minimum(half / extents(grid, blocks, stride), 1).astype(np.float32))
    least, most = _over_octants(np.minimum, interpolated), _over_octants(np.maximum, interpolated)
    bent = ~sloped & (np.maximum(least, -most) > (believed.bends[coarse] * bends)[:, None])
    reached, outside = octants & ~(sloped | bent), octants & (sloped | bent)
    skipped = rows(Skipped(blocks, bends, outside, outside & bent), outside.any(axis=1))
    halves = (2 * blocks[:, None] + CORNERS)[reached]
    points = np.minimum((halves[:, None] + CORNERS) * half, grid.last)
    found = grid.evaluate(points.reshape(-1, 3)).reshape(-1, len(CORNERS))
    if half == 1:
        grid.add_cells(halves)
        return None, skipped
    away = np.abs(found - interpolated.reshape(-1, 27)[:, OF_OCTANT][reached]).max(axis=1)
    return halved(grid, halves, np.maximum(away, ROUNDING), half), skipped


def coarse_blocks(grid: Grid, blocks: Blocks, stride: int) -> tuple[Int[ndarray, " n"], ...]:
    """Index of the coarse block around each."""
    return tuple((blocks * stride // grid.stride).T)


def extents(grid: Grid, blocks: Blocks, stride: int) -> Int[ndarray, "n 3"]:
    """Cells along the edges of each block: the stride, but at the grid's end."""
    return np.minimum((blocks + 1) * stride, grid.last) - blocks * stride


def rows(table: Table, chosen: Bool[ndarray, " n"] | slice) -> Table:
    """Some of the blocks."""
    return type(table)(*(column[chosen] for column in table))


def _between_corners(values: Float[ndarray, "n 8"], middles: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3 3 3"]:
    """Trilinear interpolation of a block's corners at its 27 points, the middle ones so far along each axis."""
    cube = values.reshape(-1, 2, 2, 2)
    for axis in range(3):
        low, high = cube.take(0, axis=axis + 1), cube.take(1, axis=axis + 1)
        cube = np.stack([low, low + (high - low) * middles[:, axis, None, None], high], axis=axis + 1)
    return cube


def _over_octants(extreme: np.ufunc, cube: Float[ndarray, "n 3 3 3"]) -> Float[ndarray, "n 8"]:
    """The least or the most of the values at each octant's corners."""
    cube = extreme(cube[:, :-1], cube[:, 1:])
    cube = extreme(cube[:, :, :-1], cube[:, :, 1:])
    return np.asarray(extreme(cube[..., :-1], cube[..., 1:]).reshape(-1, 8))
