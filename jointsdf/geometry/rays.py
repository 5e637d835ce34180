"""First hits of rays with a triangle mesh, by Embree (Wald et al., "Embree", ACM TOG 2014)."""

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from jaxtyping import Float, Int
from numpy import ndarray


def ray_lengths(
    corners: Float[ndarray, "f 3 3"], origins: Float[ndarray, "n 3"], directions: Float[ndarray, "n 3"]
) -> Float[ndarray, " n"]:
    """Length of each ray up to its first hit, infinite where it has none; the arguments are those of `ray_hits`."""
    return ray_hits(corners, origins, directions)[0]


def ray_hits(
    corners: Float[ndarray, "f 3 3"], origins: Float[ndarray, "n 3"], directions: Float[ndarray, "n 3"]
) -> tuple[Float[ndarray, " n"], Int[ndarray, " n"]]:
    """Length of each ray up to its first hit and the face hit; infinite and -1 where there is none.

    Args:
        corners: Of the faces, in a frame where the mesh is at most about 1 across: the rays are cast in float32.
        origins: Starts of the rays, same frame.
        directions: Unit vectors.

    >>> triangle = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    >>> ray_hits(triangle, np.array([[0.25, 0.25, 2.0], [9, 9, 2]]), np.array([[0.0, 0, -1], [0, 0, -1]]))
    (array([ 2., inf]), array([ 0, -1]))
    """
    scene = EmbreeScene()
    TriangleMesh(scene, corners.astype(np.float32))
    hits = scene.run(origins.astype(np.float32), directions.astype(np.float32), output=True)
    faces = hits["primID"].astype(np.int64)
    return np.where(faces < 0, np.inf, hits["tfar"].astype(np.float64)), faces
