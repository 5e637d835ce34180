"""The exact distance on a grid, interpolated linearly, in the columns of a field, whose peer it is off the surface.

The grid spans the training box. Bytes are those of its float32 values.
"""

import os
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from benchmarks.table import Row
from jointsdf.data.point_cloud import Cloud
from jointsdf.evaluation.protocol import bounding_frame
from jointsdf.geometry.distance import network_distance
from jointsdf.metrics.distance import Distance, UnitField
from jointsdf.shapes import abc, load
from jointsdf.values import BOX

SHAPES = (
    "abc_0001",
    "abc_0008",
    "abc_0016",
    "abc_0023",
    "abc_0033",
    "abc_0034",
    "abc_0045",
    "abc_0046",
    "abc_0048",
    "abc_0049",
)
SIZES = (32, 64, 128)
COLUMNS = (
    "sdf_relative_mean", "sdf_relative_p99", "sdf_ratio", "gradient_angle_median", "eikonal_error", "overshoot",
    "overshoot_b5", "sign_error", "sdf_error_p99_b1",
)  # fmt: skip


def rows(shapes: Sequence[str] = SHAPES, sizes: Sequence[int] = SIZES, points: int = 20_000) -> list[Row]:
    """Means over the shapes, of each size of grid.

    Args:
        shapes: Names; those of ABC are left out where their meshes are not at hand.
        sizes: Grid points along each axis.
        points: In the box, and in each band.
    """
    root = os.environ.get("JOINTSDF_ABC", "")
    here = [name for name in shapes if name not in abc.catalogue() or (root and abc.mesh_path(name, root).is_file())]
    found: list[Row] = []
    scores = {size: [measure(name, root, size, points) for name in here] for size in sizes}
    for size, of_shapes in scores.items():
        for column in COLUMNS if of_shapes else ():
            mean = float(np.mean([each[column] for each in of_shapes]))
            found.append(
                Row(f"grid {size}^3: {column}", f"mean of {len(here)} shapes", mean, 4.0 * size**3, "bytes", mean)
            )
    return found


def measure(name: str, root: str, size: int, points: int) -> dict[str, float]:
    """Errors of one shape's grid, in the columns of a run."""
    shape = load(name, labels="none", segmented=False, abc_root=root or "data/abc", abc_missing="error")
    frame, to_network = bounding_frame(shape.mesh), Cloud.of(shape.mesh, count=30_000, seed=0).normalisation
    exact = network_distance(shape, frame)
    low, high = frame.forward(to_network.inverse(np.array([[-BOX] * 3, [BOX] * 3])))
    axes = [np.linspace(a, b, size) for a, b in zip(low, high, strict=True)]
    corners = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    values = exact.signed(corners).reshape(size, size, size)
    return Distance(points)(trilinear(values, low, high), exact, np.stack([low, high]))


def trilinear(values: Float[ndarray, "n n n"], low: Float[ndarray, "3"], high: Float[ndarray, "3"]) -> UnitField:
    """Interpolate values on a grid linearly along each axis; also the interpolant's exact gradient.

    Args:
        values: At the grid points.
        low: Position of the first one.
        high: Position of the last one.
    """
    cells = np.array(values.shape) - 1

    def field(points: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, " n"], Float[ndarray, "n 3"]]:
        at = (points - low) / (high - low) * cells
        first = np.clip(np.floor(at).astype(np.int64), 0, cells - 1)
        share = at - first
        value, gradient = np.zeros(len(points)), np.zeros((len(points), 3))
        for corner in np.ndindex(2, 2, 2):
            known = values[tuple((first + corner).T)]
            weights = np.where(corner, share, 1 - share)
            value += known * weights.prod(axis=1)
            for axis in range(3):
                others = np.delete(weights, axis, axis=1).prod(axis=1)
                gradient[:, axis] += known * others * (1 if corner[axis] else -1)
        return value, gradient * cells / (high - low)

    return field
