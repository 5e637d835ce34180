"""Where creases are seen best: the place with the most of them, and the direction that shows both sides of them."""

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.spatial import KDTree

from jointsdf.geometry.creases import Creases
from jointsdf.geometry.mesh import unit
from jointsdf.geometry.rays import ray_lengths
from jointsdf.values import LabelledMesh
from jointsdf.viewing.raycast import viewing_axes

PLACES = 4000  # along the creases, equally far apart
SEEN = 500  # of them, near the place, that a direction is judged by
AZIMUTHS = np.arange(-172.0, 180.0, 15.0)  # degrees; none along an axis
ELEVATIONS = (28.0, 50.0, 10.0, -28.0, -50.0)
USUAL = (-52.0, 28.0)  # azimuth and elevation where no crease is near
CLEAR = 0.02  # distance from the crease, in radii of the place, from which a ray goes to the viewer


def crowded_place(creases: Creases, radius: float) -> Float[ndarray, "3"]:
    """The point on creases with the greatest length of them in the ball about it.

    Args:
        creases: At least one.
        radius: Of the ball.
    """
    points, _ = _spread(creases)
    around = KDTree(points).query_ball_point(points, radius, return_length=True, workers=-1)
    place: ndarray = points[np.argmax(around)]
    return place


def best_axes(mesh: LabelledMesh, creases: Creases, place: Float[ndarray, "3"], radius: float, up: str) -> ndarray:
    """Axes of the camera that sees the most of the creases near a place with both of their sides.

    A point of a crease that nothing hides counts by the cosine between the direction to the viewer and the normal of
    that side which is seen more from its edge. Of equally good directions the first of `AZIMUTHS` and `ELEVATIONS` is
    taken.

    Args:
        mesh: With the creases; hides what is behind it.
        creases: May be none.
        place: Looked at.
        radius: Of the ball about it whose creases count.
        up: Axis of the mesh's frame that points up.

    Returns:
        As of `Camera`.
    """
    points, normals = _spread(creases)
    near = np.flatnonzero(np.linalg.norm(points - place, axis=1) < radius)
    near = near[:: -(-len(near) // SEEN) or 1]
    if len(near) == 0:
        return viewing_axes(*USUAL, up)
    size = np.ptp(mesh.vertices, axis=0).max()
    corners = (mesh.vertices[mesh.faces] - place) / size
    starts = points[near] + CLEAR * radius * unit(normals[near].sum(axis=1))
    candidates = [viewing_axes(azimuth, elevation, up) for elevation in ELEVATIONS for azimuth in AZIMUTHS]
    towards = -np.stack([axes[2] for axes in candidates])
    facing = np.einsum("nsd,cd->cns", normals[near], towards).min(axis=2).clip(0)
    seen = _in_sight(corners, (starts - place) / size, towards)
    return candidates[int(np.argmax((facing * seen).sum(axis=1)))]


def best_direction(
    mesh: LabelledMesh, points: Float[ndarray, "n 3"], normals: Float[ndarray, "n 3"], radius: float
) -> tuple[float, float]:
    """Azimuth and elevation, degrees, from which most of the points are seen, each by the cosine to its normal.

    Args:
        mesh: Hides what is behind it.
        points: On it.
        normals: Unit normals there.
        radius: Of the place that the points are at.
    """
    size = float(np.ptp(mesh.vertices, axis=0).max())
    directions = [(azimuth, elevation) for elevation in ELEVATIONS for azimuth in (USUAL[0], *AZIMUTHS)]
    towards = -np.stack([viewing_axes(*direction)[2] for direction in directions])
    seen = _in_sight(mesh.vertices[mesh.faces] / size, (points + CLEAR * radius * normals) / size, towards)
    found = directions[int(np.argmax(((normals @ towards.T).T.clip(0) * seen).sum(axis=1)))]
    return float(found[0]), float(found[1])


def _in_sight(
    corners: Float[ndarray, "f 3 3"], starts: Float[ndarray, "n 3"], towards: Float[ndarray, "c 3"]
) -> Bool[ndarray, "c n"]:
    """Whether nothing hides each point, by direction."""
    origins = np.tile(starts, (len(towards), 1))
    lengths = ray_lengths(corners, origins, np.repeat(towards, len(starts), axis=0))
    return np.isinf(lengths).reshape(len(towards), len(starts))


def _spread(creases: Creases) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 2 3"]]:
    """Points equally far apart along the creases, one after the other, and the normals of their sides."""
    reached = np.cumsum(np.linalg.norm(creases.ends - creases.starts, axis=1))
    if len(reached) == 0:
        return creases.starts, creases.normals
    at = (np.arange(PLACES) + 0.5) / PLACES * reached[-1]
    piece = np.searchsorted(reached, at)
    left = (reached[piece] - at)[:, None]
    back = unit(creases.starts - creases.ends)[piece]
    return creases.ends[piece] + left * back, creases.normals[piece]
