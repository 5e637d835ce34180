"""Volumes of shafts."""

import pytest
from solids import DISC, volume

from jointsdf.shapes.builtin.shafts import stepped_shaft


def test_shaft_is_its_cylinders_without_groove_and_hole() -> None:
    steps = [("a", 20, 8), ("b", 31, 14), ("c", 11, 9)]  # each overlaps the smaller one before or starts inside it by 1
    grooves = [(30, 4, 11)]
    mesh = stepped_shaft(at=(1, 2, 3), steps=steps, key_slots=(), centre_hole=(10, 3), grooves=grooves)
    expected = DISC * (19 * 8**2 + 31 * 14**2 + 10 * 9**2 - 4 * (14**2 - 11**2) - 10 * 3**2)
    assert volume(mesh) == pytest.approx(expected, rel=1e-6)
