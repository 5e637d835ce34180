"""Errors of a fit's surface against its ground truth and back, at the vertices and faces of what is shown."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.spatial import KDTree

from jointsdf.geometry.distance import ClosestPoint, ExactDistance
from jointsdf.geometry.mesh import face_normals
from jointsdf.model.field import JointField
from jointsdf.values import UNLABELLED, LabelledMesh, Scan


@dataclass(frozen=True)
class Errors:
    """Errors of one surface against another; None where there are none.

    Attributes:
        error: Signed distance at each vertex (or point), file units: positive where the fit has material too much.
        normal: Angle between normals of each face, degrees.
        wrong: Whether each face (or point) has another part than what it is compared with.
    """

    error: Float[ndarray, " v"] | None = None
    normal: Float[ndarray, " f"] | None = None
    wrong: Bool[ndarray, " f"] | None = None


def errors_of_fit(truth: LabelledMesh, exact: ExactDistance, full: ClosestPoint, shown: LabelledMesh) -> Errors:
    """Errors of a fit against its ground truth.

    Each vertex that is shown is taken to the closest point of the full surface, so that its distance is that of the
    extracted mesh, whatever was merged for the screen.

    Args:
        truth: Ground truth, file frame.
        exact: Its signed distance.
        full: The extracted mesh.
        shown: The mesh on the screen.
    """
    error = exact.signed(full.nearest(shown.vertices))
    nearest = exact.closest_face(_centroids(shown))
    normal = _angles(_normals(shown), _normals(truth)[nearest])
    return Errors(error, normal, _wrong(shown.labels, truth.labels[nearest]))


def errors_of_truth(
    shown: LabelledMesh, fit: LabelledMesh, full: ClosestPoint, full_labels: Int[ndarray, " f"], field: JointField
) -> Errors:
    """Errors of a fit as the ground truth sees them: exact distances, with the field's sign.

    Args:
        shown: Ground truth on the screen.
        fit: The fit on the screen, whose normals are compared.
        full: The extracted mesh.
        full_labels: Parts of its faces.
        field: The fitted field: what is inside the fit has material too much beyond it.
    """
    inside = _inside(field, shown.vertices)
    error = np.where(inside, 1.0, -1.0) * full.query(shown.vertices)[0]
    middles = _centroids(shown)
    normal = _angles(_normals(shown), _normals(fit)[ClosestPoint(fit).query(middles)[1]])
    return Errors(error, normal, _wrong(full_labels[full.query(middles)[1]], shown.labels))


def errors_of_points(
    scan: Scan, chosen: Int[ndarray, " n"], full: ClosestPoint, labels: ndarray, field: JointField
) -> Errors:
    """Errors of a fit at points that it was fitted to, as `errors_of_truth`."""
    points = scan.points[chosen]
    distances, nearest = full.query(points)
    inside = _inside(field, points)
    return Errors(np.where(inside, 1.0, -1.0) * distances, None, _wrong(labels[nearest], scan.labels[chosen]))


def errors_beside_points(scan: Scan, shown: LabelledMesh) -> Errors:
    """Distance of each vertex from the nearest point of a cloud, without sign."""
    return Errors(error=KDTree(scan.points).query(shown.vertices)[0])


def _inside(field: JointField, points: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
    inside: Bool[ndarray, " n"] = field.network_sdf(field.normalisation.forward(points)) < 0
    return inside


def _centroids(mesh: LabelledMesh) -> Float[ndarray, "f 3"]:
    middles: Float[ndarray, "f 3"] = mesh.vertices[mesh.faces].mean(axis=1)
    return middles


def _normals(mesh: LabelledMesh) -> Float[ndarray, "f 3"]:
    return face_normals(mesh.vertices, mesh.faces)


def _angles(one: Float[ndarray, "n 3"], other: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
    sine, cosine = np.linalg.norm(np.cross(one, other), axis=1), np.einsum("nd,nd->n", one, other)
    degrees: Float[ndarray, " n"] = np.degrees(np.arctan2(sine, cosine))
    return degrees


def _wrong(predicted: Int[ndarray, " n"], true: Int[ndarray, " n"]) -> Bool[ndarray, " n"] | None:
    """Faces with a wrong label, of those that have one; None where none is labelled."""
    if (predicted == UNLABELLED).all() or (true == UNLABELLED).all():
        return None
    return np.asarray((predicted != true) & (true != UNLABELLED))
