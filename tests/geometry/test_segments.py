"""Points along segments, and the nearest segment, against brute force."""

import numpy as np
import pytest

from jointsdf.geometry.segments import nearest_segment, points_along


def test_points_along_segments_are_even_and_carry_the_length() -> None:
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 0.0004, 0], [1, 0.0004, 0]])
    points, lengths, segment = points_along(corners[:-1], corners[1:], 0.001)
    assert len(points) == 1001
    np.testing.assert_allclose(points[:1000, 0], (np.arange(1000) + 0.5) / 1000, atol=1e-12)
    np.testing.assert_allclose(points[1000], [1, 0.0002, 0], atol=1e-15)
    np.testing.assert_array_equal(segment, np.repeat([0, 1], [1000, 1]))
    assert lengths.sum() == pytest.approx(1.0004)


def test_no_segment_has_no_points() -> None:
    assert len(points_along(np.zeros((0, 3)), np.zeros((0, 3)), 0.1)[0]) == 0


def test_the_nearest_segment_is_that_of_brute_force() -> None:
    rng = np.random.default_rng(0)
    points, starts, along = rng.random((300, 3)), rng.random((80, 3)), rng.normal(size=(80, 3)) * 0.3
    offset = points[:, None] - starts
    share = np.clip((offset * along).sum(axis=2) / (along**2).sum(axis=1), 0, 1)
    expected = np.linalg.norm(offset - share[..., None] * along, axis=2)
    distances, nearest = nearest_segment(points, starts, starts + along)
    np.testing.assert_allclose(distances, expected.min(axis=1), atol=1e-12)
    np.testing.assert_array_equal(nearest, expected.argmin(axis=1))
    assert len(nearest_segment(points[:0], starts, starts + along)[0]) == 0
