"""Faces of one mesh in another order."""

import numpy as np
import pytest
import trimesh
from partfield_output import BAR, ORDER

from jointsdf.shapes.labels.face_matching import match_faces


def test_matching_finds_permuted_faces_and_turned_corners() -> None:
    turned = np.roll(BAR.triangles[ORDER], 1, axis=1) * 0.3 - 7
    np.testing.assert_array_equal(match_faces("it", turned, BAR.triangles), np.argsort(ORDER))
    flipped = BAR.triangles[ORDER][:, ::-1]
    np.testing.assert_array_equal(match_faces("it", flipped, BAR.triangles), np.argsort(ORDER))
    rounded = BAR.triangles[ORDER].round(5)
    np.testing.assert_array_equal(match_faces("it", rounded, BAR.triangles), np.argsort(ORDER))


def test_matching_tells_faces_that_touch_by_their_normals(caplog: pytest.LogCaptureFixture) -> None:
    other = trimesh.creation.box(transform=trimesh.transformations.translation_matrix((1, 0, 0)))
    corners = np.concatenate([trimesh.creation.box().triangles, other.triangles])
    order = np.random.default_rng(0).permutation(24)
    np.testing.assert_array_equal(match_faces("it", corners[order], corners), np.argsort(order))
    assert "matched by their centres" in caplog.text
    caplog.clear()
    np.testing.assert_array_equal(match_faces("it", corners, corners), np.arange(24))
    assert not caplog.records
