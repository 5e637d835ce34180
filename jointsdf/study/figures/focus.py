"""Where a fit is worst: the place that a picture of a failure zooms to, and the direction that shows it."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import KDTree

from jointsdf.geometry.mesh import face_areas, face_normals
from jointsdf.values import LabelledMesh
from jointsdf.viewing.error_view import centroids
from jointsdf.viewing.viewpoint import best_direction

RADIUS, LABEL_RADIUS = 0.08, 0.03  # of the place, of the longest side; wrong labels are strips at the borders of parts
MOST, JUDGES = 4000, 300  # faces that may be the place's middle, and those that a direction is judged by
SIGNS = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), axis=-1).reshape(-1, 3)


class Focus(NamedTuple):
    """What a picture shows.

    Attributes:
        corners: Of the cube about the place, file frame: what the camera is fitted to.
        azimuth: Of the viewer, degrees.
        elevation: Of the viewer, degrees.
    """

    corners: Float[ndarray, "8 3"]
    azimuth: float
    elevation: float


def find_focus(mesh: LabelledMesh, errors: Float[ndarray, " f"], radius: float) -> Focus | None:
    """The ball with the most error in it, by area; None where there is no error.

    Args:
        mesh: File frame.
        errors: Of each face, at least 0; the largest count most.
        radius: Of the ball, file units.
    """
    shares = errors * face_areas(mesh)
    worst = np.argsort(-shares, kind="stable")[:MOST]
    worst = worst[shares[worst] > 0]
    if not len(worst):
        return None
    points = centroids(mesh)[worst]
    near = KDTree(points).query_ball_point(points, radius)
    place = max(range(len(worst)), key=lambda k: float(shares[worst[near[k]]].sum()))
    inside = np.array(near[place])[:JUDGES]
    normals = face_normals(mesh.vertices, mesh.faces[worst[inside]])
    middle = np.average(points[inside], axis=0, weights=shares[worst[inside]])
    return Focus(middle + radius * SIGNS, *best_direction(mesh, points[inside], normals, radius))
