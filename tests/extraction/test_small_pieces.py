"""Small pieces left out of a surface."""

import numpy as np
import pytest

from jointsdf.errors import InputError
from jointsdf.extraction import Extraction
from jointsdf.values import UNMOVED


def two_balls(points):
    """Balls of radius 0.5 at the origin and of 0.05 beside it."""
    beside = np.linalg.norm(points - np.array([0.8, 0, 0]), axis=1) - 0.05
    return np.minimum(np.linalg.norm(points, axis=1) - 0.5, beside)


@pytest.mark.parametrize(("share", "reach"), [(0, 0.85), (0.06, 0.85), (0.1, 0.5), (1, 0.5)])
def test_pieces_below_the_share_are_left_out_and_the_rest_is_the_same(share, reach):
    label = lambda points: np.zeros(len(points), dtype=np.int64)  # noqa: E731
    whole, left = (
        Extraction(resolution=65, borders="split", smallest_piece=size).labelled_mesh(two_balls, label, UNMOVED)
        for size in (0, share)
    )
    assert left.vertices[:, 0].max() == pytest.approx(reach, abs=0.01)
    near = (whole.vertices[whole.faces][:, :, 0] <= reach + 0.01).all(axis=1)
    np.testing.assert_array_equal(left.vertices[left.faces], whole.vertices[whole.faces][near])
    assert len(np.unique(left.faces)) == len(left.vertices)


def test_the_share_is_from_0_to_1():
    with pytest.raises(InputError, match=r"extraction\.smallest_piece=1\.5: give a number"):
        Extraction(smallest_piece=1.5)
