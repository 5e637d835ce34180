"""Volumes of angle brackets."""

import pytest
from solids import DISC, volume

from jointsdf.shapes.builtin.angles import angle_bracket


def test_angle_bracket_is_its_plates_without_holes() -> None:
    mesh = angle_bracket(size=(70, 50, 40), thickness=5, seat=5, ribs=(), side=30, wall_holes=((35, 20, 6),))
    boxes = 70 * 50 * 5 + 70 * 5 * 35 + 5 * 45 * 25
    assert volume(mesh) == pytest.approx(boxes - DISC * 5 * (2 * 5.5**2 + 6**2), rel=1e-6)
