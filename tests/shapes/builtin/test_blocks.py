"""Volumes of manifold blocks."""

import pytest
from solids import DISC, volume

from jointsdf.shapes.builtin.blocks import Drill, manifold_block


def test_block_is_a_box_without_its_bores() -> None:
    bores = {"blind": [Drill("x", (-1, 20, 12), 31, 4)], "through": [Drill("y", (45, -1, 12), 42, 5)]}
    mesh = manifold_block(at=(3, 2, 1), size=(60, 40, 24), bores=bores, mounting=(4, 33, 2))
    expected = 60 * 40 * 24 - DISC * (30 * 4**2 + 40 * 5**2 + 4 * 24 * 2**2)
    assert volume(mesh) == pytest.approx(expected, rel=1e-6)
