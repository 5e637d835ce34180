"""First hits of rays with a triangle mesh, by Embree."""

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from jaxtyping import Float, Int
from numpy import ndarray


def ray_lengths(
    corners: Float[ndarray, "f 3 3"], origins: Float[ndarray, "n 3"], directions: Float[ndarray, "n 3"]
) -> Float[ndarray, " n"]:
    """How far rays go until they meet a face; infinite where they meet none. The arguments are those of `ray_hits`."""
    return ray_hits(corners, origins, directions)[0]


def ray_hits(
    corners: Float[ndarray, "f 3 3"], origins: Float[ndarray, "n 3"], directions: Float[ndarray, "n 3"]
) -> tuple[Float[ndarray, " n"], Int[ndarray, " n"]]:
    """How far rays go until they meet a face, and which: infinite and -1 where they meet none.

    Args:
        corners: Of the faces, in a frame where the mesh is at most about 1 across: the rays are cast in float32.
        origins: Where the rays start, same frame.
        directions: Unit vectors.
    """
    scene = EmbreeScene()
    TriangleMesh(scene, corners.astype(np.float32))
    hits = scene.run(origins.astype(np.float32), directions.astype(np.float32), output=True)
    faces = hits["primID"].astype(np.int64)
    return np.where(faces < 0, np.inf, hits["tfar"].astype(np.float64)), faces
