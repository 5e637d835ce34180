"""The cells of a grid near the surface as libigl finds them, and its mesh of them.

`igl.lipschitz_octree` halves cells from the whole box down and drops one where the field at its centre, over the slope
that it is trusted to stay below, is farther from 0 than the corners are from the centre: one number for the whole box,
nothing that is checked, nothing that is followed. Here it stops at leaves of two cells an edge: with single cells it
asks for more points. Their corners, and all centres, are grid points: `Grid` asks the field for each once.
"""

import igl
import numpy as np
from jaxtyping import Float
from numpy import ndarray

from jointsdf.extraction.continuation import bisect_sign_changes, lattice_sign_changes, track_surface
from jointsdf.extraction.extractor import Surface
from jointsdf.extraction.marching_cubes import march
from jointsdf.extraction.pruning import SAFETY
from jointsdf.extraction.sparse_grid import CORNERS, Grid
from jointsdf.model.field import JointField
from jointsdf.values import BOX

BATCH = 1 << 17  # cells added at once
ORIGIN = np.full(3, -BOX)
YXZ = [1, 0, 2]  # libigl's order of a cell's indices; positions are in the usual one


def slope_bound(field: JointField, count: int = 20_000) -> float:
    """The steepest slope at random points of the box, and a margin on it: the one number that libigl is to be given."""
    points = np.random.default_rng(0).uniform(-BOX, BOX, (count, 3))
    gradients = field.query(field.normalisation.inverse(points), what="gradient").gradient
    return SAFETY * float(np.linalg.norm(gradients, axis=1).max())


def libigl_mesh(grid: Grid, slope: float) -> Surface:
    """The surface by libigl alone: its octree, and its marching cubes over the cells.

    Args:
        grid: Without cells.
        slope: That the field is trusted to stay below.
    """
    add_octree(grid, slope)
    depth = root_depth(grid)
    cells = np.ascontiguousarray(grid.active_cells()[:, YXZ])
    points, corners, places = igl.unique_sparse_voxel_corners(ORIGIN, grid.spacing * 2**depth, depth, cells)
    values = grid.evaluate(points[:, YXZ].astype(np.int64)).astype(np.float64)
    vertices, faces, _ = igl.marching_cubes(values, places, corners, 0.0)
    return Surface(vertices, faces.astype(np.int64), grid.evaluations / (grid.last + 1) ** 3)


def followed_mesh(grid: Grid, slope: float) -> Surface:
    """The surface by libigl's octree, followed our way where it leaves the octree's cells, and by our marching cubes.

    Args:
        grid: Without cells.
        slope: That the field is trusted to stay below.
    """
    add_octree(grid, slope)
    bisect_sign_changes(grid, lattice_sign_changes(grid))
    track_surface(grid)
    return Surface(*march(grid), grid.evaluations / (grid.last + 1) ** 3)


def add_octree(grid: Grid, slope: float) -> None:
    """Add the cells that libigl's octree keeps to the grid, corners evaluated."""

    def distance(points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        asked = np.rint((points + BOX) / grid.spacing).astype(np.int64)
        nearest = np.minimum(asked, grid.last)  # the root reaches beyond the box, where nothing is known of the field
        beyond = grid.spacing * np.linalg.norm(asked - nearest, axis=1)
        return np.maximum(np.abs(grid.evaluate(nearest)) / slope, beyond)

    depth = root_depth(grid)
    leaves = igl.lipschitz_octree(ORIGIN, grid.spacing * 2**depth, depth - 1, distance)
    leaves = leaves.astype(np.int64).reshape(-1, 3)[:, YXZ]  # without any it gives no columns
    cells = (2 * leaves[:, None] + CORNERS).reshape(-1, 3)
    cells = cells[(cells < grid.last).all(axis=1)]
    for part in np.array_split(cells, len(cells) // BATCH + 1):
        grid.evaluate((part[:, None] + CORNERS).reshape(-1, 3))
        grid.activate(part)


def root_depth(grid: Grid) -> int:
    """Halvings from a root that holds the whole grid to a single cell."""
    return (grid.last - 1).bit_length()
