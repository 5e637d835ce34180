"""Creases told from roundings by the field itself, near the line in which the planes of two sides meet.

A fitted field rounds a crease by up to about a cell: its normal turns from one side's to the other's near the line, and
hardly beyond. On a rounding of a larger radius it goes on turning. The normals at two distances from the line, on both
sides, tell the two apart; neighbours along a crease decide together.
"""

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from jointsdf.extraction.crease_band import Band, Differential
from jointsdf.extraction.crease_lines import Crossings, beside, candidates, meeting_lines
from jointsdf.geometry.mesh import unit

NEAR, FAR = 0.75, 1.5  # distances from the line at which normals are asked, cells
SHARES = (0.75, 0.55, 0.5)  # of the turn within `FAR`, that is within `NEAR` at a crease
LEAST = np.radians([0.0, 25.0, 40.0])  # turn within `NEAR` with which each of these shares is enough
JUMP = 0.6  # beyond the plane of a side by which the normal turns, radians: more is another crease
PASSES = 2  # of the search, the second among the vertices that the first put on planes of their own
SMOOTHED, VOTES = 2, 16  # rounds in which neighbours along a crease take the mean of their angles, and vote


def find_crossings(band: Band, differential: Differential, cell: float) -> tuple[Band, Crossings]:
    """Find the edges that a crease runs across.

    Args:
        band: Around the creases.
        differential: Points -> signed distances and gradients.
        cell: Edge of a cell of the grid.

    Returns:
        The band, where vertices that are beside no crease are on planes of their own, and the crossings.
    """
    tested, kept = np.ones(len(band.edges), dtype=bool), np.zeros(len(band.edges), dtype=bool)
    for _ in range(PASSES):
        rows, found = candidates(band, tested, cell)
        if not len(rows):
            break
        kept[rows] = sharp = _are_sharp(band, found, differential, cell)
        rounded = np.zeros(len(band.points), dtype=bool)
        rounded[found.ends[~sharp]] = True
        rounded[band.edges[kept]] = False
        band = band.with_own_planes(rounded)
        tested = rounded[band.edges].any(axis=1)
    crossings = meeting_lines(band, band.edges[kept])
    return band.with_own_planes(~beside(band, crossings)), crossings


def _are_sharp(band: Band, crossings: Crossings, differential: Differential, cell: float) -> Bool[ndarray, " e"]:
    """Mark the creases; one edge in each cell is asked for all in it."""
    cells = np.floor(crossings.origins / cell).astype(np.int64)
    _, asked, number = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    near, far = _turns(band, crossings.rows(asked), differential, cell)[:, number.reshape(-1)]
    near = _along_creases(crossings.ends, near, len(band.points), SMOOTHED)
    far = _along_creases(crossings.ends, far, len(band.points), SMOOTHED)
    sharp = np.zeros(len(near), dtype=bool)
    for share, least in zip(SHARES, LEAST, strict=True):
        sharp |= (near > share * far) & (near > least)
    return _along_creases(crossings.ends, np.where(sharp, 1.0, -1.0), len(band.points), VOTES) > 0


def _turns(band: Band, crossings: Crossings, differential: Differential, cell: float) -> Float[ndarray, "2 e"]:
    """Angles between the field's normals on the two sides of lines, at `NEAR` and at `FAR` from them."""
    own = band.normals[crossings.ends]
    probes = crossings.origins[:, None] + cell * np.array([NEAR, FAR])[:, None, None, None] * crossings.inward
    gradients = differential(probes.reshape(-1, 3))[1].reshape(probes.shape)
    middle = unit(own.sum(axis=1))[:, None]
    outward = unit(own - (own * middle).sum(axis=-1, keepdims=True) * middle)
    half = np.arccos(np.clip((own * middle).sum(axis=-1), -1, 1))
    near, far = np.arctan2((gradients * outward).sum(axis=-1), (gradients * middle).sum(axis=-1))
    far = np.where((far > half) & (far < half + JUMP), far, half)
    return np.stack([near.sum(axis=1), far.sum(axis=1)])


def _along_creases(
    ends: Int[ndarray, "e 2"], values: Float[ndarray, " e"], count: int, rounds: int
) -> Float[ndarray, " e"]:
    """Values of edges as means over edges that share a vertex with them, `rounds` times."""
    number = np.maximum(np.bincount(ends.ravel(), minlength=count), 1)
    for _ in range(rounds):
        values = (np.bincount(ends.ravel(), np.repeat(values, 2), count) / number)[ends].mean(axis=1)
    return values
