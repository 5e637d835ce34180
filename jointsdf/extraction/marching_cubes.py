"""Marching cubes over the active cells of a grid, slab by slab, with the slabs welded where they meet.

Source: Lewiner et al., "Efficient Implementation of Marching Cubes' Cases with Topological Guarantees" (2003), as
scikit-image has it.
"""

import numpy as np
from jaxtyping import Bool, Float, Float32, Int
from numpy import ndarray
from skimage.measure import marching_cubes

from jointsdf.extraction.sparse_grid import UNKNOWN, Grid, TooLarge
from jointsdf.values import BOX

MOST_FACES = 30_000_000  # of a surface, whose measures take 10 GB
SLAB_THICKNESS = 32  # cells: bounds the memory, and the cost of a call is small against so many cells


def march(grid: Grid) -> tuple[Float[ndarray, "v 3"], Int[ndarray, "f 3"]]:
    """The zero level set within the active cells.

    Returns:
        Vertices, network frame, and faces, counter-clockwise seen from outside.

    Raises:
        TooLarge: It has more than `MOST_FACES` faces.
    """
    vertices, faces, count, size = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], 0, 0
    layers = SLAB_THICKNESS // grid.side
    for first in range(0, len(grid.bricks), layers):
        values, mask = _gather_slab(grid, first, layers)
        if not mask.any() or values.min() > 0 or values[values < UNKNOWN].max() < 0:
            continue
        try:
            points, triangles, *_ = marching_cubes(values, 0.0, mask=mask, allow_degenerate=False)
        except RuntimeError:  # skimage raises it for a level set of single points
            continue
        vertices.append(points + np.array([first * grid.side, 0, 0], dtype=np.float64))
        faces.append(triangles.astype(np.int64) + count)
        count, size = count + len(points), size + len(triangles)
        if size > MOST_FACES:
            raise TooLarge(grid.last + 1, f"more than {MOST_FACES / 1e6:.0f} million faces")
    welded, triangles = _weld(np.concatenate(vertices), np.concatenate(faces), layers * grid.side)
    return welded * grid.spacing - BOX, triangles


def _gather_slab(grid: Grid, first: int, layers: int) -> tuple[Float32[ndarray, "x y z"], Bool[ndarray, "x y z"]]:
    """Values at the points of layers of bricks, and the mask of their active cells, each at its upper corner."""
    side, points = grid.side, grid.last + 1
    bricks = grid.bricks[first : first + layers + 1]
    shape = (len(bricks), side, bricks.shape[1], side, bricks.shape[2], side)
    deep = min(layers * side, grid.last - first * side) + 1
    made = np.nonzero(bricks >= 0)
    values, cells = np.full(shape, UNKNOWN), np.zeros(shape, dtype=bool)
    for array, stored in ((values, grid.values), (cells, grid.active)):
        array[made[0], :, made[1], :, made[2], :] = stored[bricks[made]].reshape(-1, side, side, side)
    whole = tuple(length * side for length in bricks.shape)
    mask = np.zeros((deep, points, points), dtype=bool)
    mask[1:, 1:, 1:] = cells.reshape(whole)[: deep - 1, : points - 1, : points - 1]
    return np.ascontiguousarray(values.reshape(whole)[:deep, :points, :points]), mask


def _weld(
    vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], thickness: int
) -> tuple[Float[ndarray, "w 3"], Int[ndarray, "f 3"]]:
    """Merge the vertices of two slabs at the same place in the plane between them."""
    between = np.flatnonzero(vertices[:, 0] % thickness == 0)
    places, owner = np.unique(vertices[between], axis=0, return_inverse=True)
    new = np.zeros(len(vertices), dtype=np.int64)
    within = np.setdiff1d(np.arange(len(vertices)), between)
    new[within] = np.arange(len(within))
    new[between] = len(within) + owner.reshape(-1)
    return np.concatenate([vertices[within], places]), new[faces]
