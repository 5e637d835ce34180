"""Exact signed distance and closest face of a triangle mesh, by libigl.

The sign of a watertight mesh is that of the angle-weighted pseudonormal, exact everywhere. The sign of any other mesh
is that of the generalised winding number: right away from the holes, a smooth guess near them.
"""

from collections.abc import Iterator

import igl
import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.values import LabelledMesh

# Points per libigl call. Bounds the memory; large, because every call builds its search tree anew.
CHUNK = 1 << 18


class ExactDistance:
    """Signed distance to a mesh, negative inside, in the frame and unit of the mesh's vertices.

    Args:
        mesh: The surface. Faces counter-clockwise seen from outside, no degenerate face, at least one.
        watertight: Whether every edge has exactly two faces; chooses where the sign comes from.
    """

    def __init__(self, mesh: LabelledMesh, *, watertight: bool) -> None:
        assert not mesh.is_empty, "no distance to an empty mesh"
        self.vertices = np.ascontiguousarray(mesh.vertices, dtype=np.float64)
        self.faces = np.ascontiguousarray(mesh.faces, dtype=np.int64)
        self.watertight = watertight

    def signed(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """Distance to the closest point of the surface, negative inside.

        Args:
            points: Where, in the frame of the mesh's vertices.
        """
        measure = self._pseudonormal if self.watertight else self._winding
        return np.concatenate([np.zeros(0), *(measure(chunk) for chunk in _chunks(points))])

    def closest_face(self, points: Float[ndarray, "n 3"]) -> Int[ndarray, " n"]:
        """Index of the face that holds the closest point of the surface.

        Args:
            points: Where, in the frame of the mesh's vertices.
        """
        found = [igl.point_mesh_squared_distance(chunk, self.vertices, self.faces)[1] for chunk in _chunks(points)]
        return np.concatenate([np.zeros(0, np.int64), *found]).astype(np.int64)

    def _pseudonormal(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        sign = igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
        distances: ndarray = igl.signed_distance(points, self.vertices, self.faces, sign)[0]
        return distances

    def _winding(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        # libigl's own fast-winding distance scales the value by 1 - 2w, and w is approximate: only its sign is used.
        squared = igl.point_mesh_squared_distance(points, self.vertices, self.faces)[0]
        winding = igl.fast_winding_number(self.vertices, self.faces, points)
        return np.where(winding > 0.5, -1.0, 1.0) * np.sqrt(squared)


def _chunks(points: Float[ndarray, "n 3"]) -> Iterator[Float[ndarray, "m 3"]]:
    for start in range(0, len(points), CHUNK):
        yield np.ascontiguousarray(points[start : start + CHUNK], dtype=np.float64)
