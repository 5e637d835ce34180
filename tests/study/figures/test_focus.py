"""Failures are shown where the error is."""

import numpy as np
import trimesh
from drawings import labelled

from jointsdf.study.figures.focus import find_focus
from jointsdf.values import LabelledMesh
from jointsdf.viewing.error_view import centroids
from jointsdf.viewing.raycast import fit_camera_to_points, viewing_axes


def test_the_focus_is_where_the_most_error_is_and_seen_from_there() -> None:
    mesh = labelled()
    middles = centroids(mesh)
    errors = (np.linalg.norm(middles - [1.0, 0.2, -0.3], axis=1) < 0.2) * 1.0
    errors[np.argmin(np.linalg.norm(middles - [-1.0, 0.0, 0.0], axis=1))] = 1.5  # one face alone
    focus = find_focus(mesh, errors, 0.2)
    assert focus is not None
    assert np.linalg.norm(focus.corners.mean(axis=0) - [1.0, 0.2, -0.3]) < 0.1
    np.testing.assert_allclose(np.ptp(focus.corners, axis=0), 0.4)
    away = viewing_axes(focus.azimuth, focus.elevation)[2]
    assert away[0] < -0.5, "the side x = 1 faces the viewer"
    camera = fit_camera_to_points(focus.corners, 60, 45, focus.azimuth, focus.elevation)
    assert np.abs(camera.project(middles[errors == 1])[:, :2]).max() < 30


def test_what_hides_the_error_is_looked_past() -> None:
    mesh = labelled()
    wall = trimesh.creation.box((0.1, 8.0, 8.0), trimesh.transformations.translation_matrix((2.0, 0.0, 0.0)))
    both = LabelledMesh(
        np.concatenate([mesh.vertices, wall.vertices]),
        np.concatenate([mesh.faces, wall.faces + len(mesh.vertices)]),
        np.concatenate([mesh.labels, np.full(len(wall.faces), 9)]),
    )
    top = (centroids(both)[:, 2] > 0.49) & (both.labels != 9)
    focus = find_focus(both, top * 1.0, 0.3)
    assert focus is not None
    away = viewing_axes(focus.azimuth, focus.elevation)[2]
    assert away[2] < 0, "from above"
    assert away[0] > -0.9, "not through the wall"


def test_no_error_has_no_focus() -> None:
    mesh = labelled()
    assert find_focus(mesh, np.zeros(len(mesh.faces)), 0.2) is None
