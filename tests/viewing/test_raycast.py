"""Rays against scenes of known geometry."""

import numpy as np
import pytest
from labelled_meshes import sphere

from jointsdf.viewing.raycast import cast_rays, fit_camera


def test_rays_see_the_front_of_a_sphere() -> None:
    mesh = sphere(2.0)
    camera = fit_camera(mesh, 200, 100, azimuth=30.0, elevation=20.0)
    hits = cast_rays(mesh, camera)
    row, column = np.nonzero(hits.seen)
    x, y = column + 0.5 - 100, 50 - row - 0.5
    radius = 2.0 / camera.pixel
    assert radius == pytest.approx(50 / 1.06, rel=0.01)
    assert hits.seen.sum() == pytest.approx(np.pi * radius**2, rel=0.01)
    inner = np.hypot(x, y) < 0.9 * radius
    depth = -np.sqrt(radius**2 - x[inner] ** 2 - y[inner] ** 2)
    np.testing.assert_allclose(hits.depths[row, column][inner], depth, atol=0.01 * radius)
    normals = np.stack([x[inner], y[inner], depth], axis=1) / radius
    np.testing.assert_allclose(hits.normals[row, column][inner], normals, atol=0.02)


def test_right_is_right_and_up_is_up() -> None:
    mesh = sphere(1.0)
    camera = fit_camera(mesh, 64, 64, azimuth=0.0, elevation=0.0)
    projected = camera.project(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]))
    np.testing.assert_allclose(projected * camera.pixel, [[1, 0, 0], [0, 1, 0], [0, 0, -1]], atol=1e-9)
