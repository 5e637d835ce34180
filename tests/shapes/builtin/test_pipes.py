"""Volumes of pipe fittings."""

import pytest
from solids import DISC, volume

from jointsdf.shapes.builtin.pipes import Flange, neck_flange


def test_flange_is_its_cylinders_without_its_holes() -> None:
    flange = Flange(radius=50, thickness=12, bolts=6, bolt=4)
    mesh = neck_flange(at=(7, 8, 9), flange=flange, face=(30, 2), neck=(32, 20, 30), bore=15)
    cone = 18 * (32**2 + 32 * 20 + 20**2) / 3
    expected = DISC * (50**2 * 12 + 30**2 * 2 + cone + 20**2 * 12 - 15**2 * 44 - 6 * 4**2 * 12)
    assert volume(mesh) == pytest.approx(expected, rel=1e-6)
