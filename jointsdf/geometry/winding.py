"""Fast winding number of a triangle mesh (Barill et al., SIGGRAPH 2018), by libigl, in any frame and unit."""

import igl
import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

INSIDE = 0.5  # winding number above which a point is inside


class WindingNumber:
    """The fast winding number of a mesh, closed or not, its hierarchy built once.

    libigl sums in float32, so the mesh is moved to the origin and scaled to a longest side of 1 before.

    Args:
        vertices: Positions, any frame.
        faces: Vertex indices, at least one face, counter-clockwise seen from outside.
    """

    def __init__(self, vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]) -> None:
        used = vertices[faces].reshape(-1, 3).astype(np.float64)
        low, high = used.min(axis=0), used.max(axis=0)
        self._middle, self._size = (low + high) / 2, float((high - low).max())
        self._hierarchy = igl.FastWindingNumberBVH()
        self._hierarchy.init(self._to_own_frame(used), np.arange(len(used), dtype=np.int64).reshape(-1, 3))

    def at(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """Winding number at points in the frame of the vertices: about 1 inside, 0 outside."""
        return self._hierarchy.winding_number(self._to_own_frame(points))

    def encloses(self, points: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        """Whether each point is inside."""
        return self.at(points) > INSIDE

    def _to_own_frame(self, points: ndarray) -> Float[ndarray, "n 3"]:
        return np.ascontiguousarray((points - self._middle) / self._size)
