"""Teeth of gears."""

from math import pi

import numpy as np
import pytest
from solids import as_trimesh

from jointsdf.shapes.builtin.gears import gear


def test_gear_teeth_fill_half_of_the_pitch_circle() -> None:
    mesh = as_trimesh(gear(at=(0, 0, 0), module=3, teeth=20, width=8, bore=6))
    angles = 2 * pi * (np.arange(4000) + 0.5) / 4000
    circle = np.stack([30 * np.cos(angles), 30 * np.sin(angles), np.full(4000, 4.0)], axis=1)
    filled = mesh.contains(circle)
    assert filled.mean() == pytest.approx(0.5, abs=0.01)
    assert np.count_nonzero(filled & ~np.roll(filled, 1)) == 20
    assert np.hypot(*mesh.vertices[:, :2].T).max() == pytest.approx(33, abs=1e-5)
    assert mesh.contains([[26.0, 0, 4], [26.4, 0, 4], [32.9, 0, 4]]).tolist() == [True, False, False], "root at 26.25"
