"""Hits of rays with a triangle mesh, by Embree (Wald et al., "Embree", ACM TOG 2014)."""

from collections.abc import Iterator

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from jaxtyping import Float, Int
from numpy import ndarray

STEP = 1e-6  # beyond a hit from where the next one is looked for; the mesh is about 1 across
MOST = 100  # hits of one ray


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
    return _first_hits(_scene(corners), origins, directions)


def successive_hits(
    corners: Float[ndarray, "f 3 3"],
    origins: Float[ndarray, "n 3"],
    directions: Float[ndarray, "n 3"],
    reach: Float[ndarray, " n"],
) -> Iterator[tuple[Int[ndarray, " h"], Int[ndarray, " h"]]]:
    """Follow rays through the faces: the numbers of the rays that have a next hit and the faces hit, round by round.

    A face within `STEP` behind another one is passed over.

    Args:
        corners: As of `ray_hits`.
        origins: Starts of the rays, same frame.
        directions: Unit vectors.
        reach: Length of each ray, infinite for no end.
    """
    scene, rays, travelled = _scene(corners), np.arange(len(origins)), np.zeros(len(origins))
    for _ in range(MOST):
        starts = origins[rays] + travelled[rays, None] * directions[rays]
        lengths, faces = _first_hits(scene, starts, directions[rays])
        within = travelled[rays] + lengths < reach[rays]
        rays, faces = rays[within], faces[within]
        if len(rays) == 0:
            return
        yield rays, faces
        travelled[rays] += lengths[within] + STEP


def _scene(corners: Float[ndarray, "f 3 3"]) -> EmbreeScene:
    scene = EmbreeScene()
    TriangleMesh(scene, corners.astype(np.float32))
    return scene


def _first_hits(scene: EmbreeScene, origins: ndarray, directions: ndarray) -> tuple[ndarray, ndarray]:
    hits = scene.run(origins.astype(np.float32), directions.astype(np.float32), output=True)
    faces = hits["primID"].astype(np.int64)
    return np.where(faces < 0, np.inf, hits["tfar"].astype(np.float64)), faces
