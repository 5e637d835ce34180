"""Volumes of sheet parts."""

import pytest
from solids import DISC, volume

from jointsdf.shapes.builtin.trays import heat_sink, thin_tray


def test_tray_is_a_box_without_its_cavity() -> None:
    mesh = thin_tray(at=(3, 2, 1), size=(80, 50, 30), wall=2, tubes=(), dividers=(20,), divider_height=15)
    assert volume(mesh) == pytest.approx(80 * 50 * 30 - 76 * 46 * 28 + 2 * 46 * 13, rel=1e-6)


def test_heat_sink_is_its_boxes_without_screw_holes() -> None:
    mesh = heat_sink(at=(3, 2, 1), base=(80, 60, 5), fins=7, fin=(2, 25), margin=8, screws=2)
    assert volume(mesh) == pytest.approx(80 * 60 * 5 + 7 * 2 * 25 * 64 - 4 * DISC * 5 * 2**2, rel=1e-6)
