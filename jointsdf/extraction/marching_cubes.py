"""Marching cubes (Lewiner) over the cells of a grid, slab by slab, the slabs welded where they meet."""

import numpy as np
from jaxtyping import Bool, Float, Float32, Int
from numpy import ndarray
from skimage.measure import marching_cubes

from jointsdf.extraction.sparse_grid import UNKNOWN, Grid
from jointsdf.values import BOX

THICKNESS = 32  # cells of a slab at least: bounds the memory, and one call costs little beside so many cells


def march(grid: Grid) -> tuple[Float[ndarray, "v 3"], Int[ndarray, "f 3"]]:
    """The zero level set within the grid's cells: vertices in the network frame, and faces."""
    vertices, faces, count = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], 0
    layers = THICKNESS // grid.side
    for first in range(0, len(grid.bricks), layers):
        values, mask = _slab(grid, first, layers)
        if not mask.any() or values.min() > 0 or values[values < UNKNOWN].max() < 0:
            continue
        try:
            points, triangles, *_ = marching_cubes(values, 0.0, mask=mask, allow_degenerate=False)
        except RuntimeError:  # skimage's answer to a level set of single points
            continue
        vertices.append(points + np.array([first * grid.side, 0, 0], dtype=np.float64))
        faces.append(triangles.astype(np.int64) + count)
        count += len(points)
    welded, triangles = _welded(np.concatenate(vertices), np.concatenate(faces), layers * grid.side)
    return welded * grid.spacing - BOX, triangles


def _slab(grid: Grid, first: int, layers: int) -> tuple[Float32[ndarray, "x y z"], Bool[ndarray, "x y z"]]:
    """Values at the points of so many layers of bricks, and the mask of their cells, each at its upper corner."""
    side, points = grid.side, grid.last + 1
    rows = grid.bricks[first : first + layers + 1]
    shape = (len(rows), side, rows.shape[1], side, rows.shape[2], side)
    deep = min(layers * side, grid.last - first * side) + 1
    made = np.nonzero(rows >= 0)
    values, cells = np.full(shape, UNKNOWN), np.zeros(shape, dtype=bool)
    for array, stored in ((values, grid.values), (cells, grid.cells)):
        array[made[0], :, made[1], :, made[2], :] = stored[rows[made]].reshape(-1, side, side, side)
    whole = tuple(length * side for length in rows.shape)
    mask = np.zeros((deep, points, points), dtype=bool)
    mask[1:, 1:, 1:] = cells.reshape(whole)[: deep - 1, : points - 1, : points - 1]
    return np.ascontiguousarray(values.reshape(whole)[:deep, :points, :points]), mask


def _welded(
    vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], thickness: int
) -> tuple[Float[ndarray, "w 3"], Int[ndarray, "f 3"]]:
    """One vertex for those of two slabs at the same place in the plane between them."""
    between = np.flatnonzero(vertices[:, 0] % thickness == 0)
    places, owner = np.unique(vertices[between], axis=0, return_inverse=True)
    new = np.zeros(len(vertices), dtype=np.int64)
    within = np.setdiff1d(np.arange(len(vertices)), between)
    new[within] = np.arange(len(within))
    new[between] = len(within) + owner.reshape(-1)
    return np.concatenate([vertices[within], places]), new[faces]
