"""Line segments in space, as of borders and creases: points along them, and the nearest of them."""

import igl
import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.geometry.distance import spatial_order


def points_along(
    starts: Float[ndarray, "s 3"], ends: Float[ndarray, "s 3"], spacing: float
) -> tuple[Float[ndarray, "n 3"], Float[ndarray, " n"], Int[ndarray, " n"]]:
    """Midpoints of equal pieces of segments, none longer than `spacing`: the midpoint rule along a curve.

    By the weights, many short segments count no more than one long segment in their place.

    Args:
        starts: Ends of the segments, any frame.
        ends: The other ends.
        spacing: Longest piece, same unit.

    Returns:
        The midpoints, the length of the piece of each as its weight, and the segment of each. A segment without length
        has none.

    >>> points_along(np.array([[0.0, 0, 0]]), np.array([[0.0, 3, 0]]), 1.5)[0].tolist()
    [[0.0, 0.75, 0.0], [0.0, 2.25, 0.0]]
    """
    lengths = np.linalg.norm(ends - starts, axis=1)
    pieces = np.ceil(lengths / spacing).astype(np.int64)
    segment = np.repeat(np.arange(len(starts)), pieces)
    piece = np.arange(len(segment)) - (np.cumsum(pieces) - pieces)[segment]
    along = (piece + 0.5) / pieces[segment]
    return starts[segment] + along[:, None] * (ends - starts)[segment], lengths[segment] / pieces[segment], segment


def nearest_segment(
    points: Float[ndarray, "n 3"], starts: Float[ndarray, "s 3"], ends: Float[ndarray, "s 3"]
) -> tuple[Float[ndarray, " n"], Int[ndarray, " n"]]:
    """Exact distance of points to the nearest of some segments, and that segment, by libigl's search tree.

    Args:
        points: Any frame.
        starts: Ends of the segments, at least one, each of some length; same frame.
        ends: The other ends.
    """
    vertices = np.ascontiguousarray(np.concatenate([starts, ends]), dtype=np.float64)
    pairs = np.arange(len(vertices)).reshape(2, -1).T
    order = spatial_order(points)
    asked = np.ascontiguousarray(points[order], dtype=np.float64)
    squared, found, _ = igl.point_mesh_squared_distance(asked, vertices, np.ascontiguousarray(pairs))
    back = np.argsort(order)
    return np.sqrt(squared[back]), found[back].astype(np.int64)
