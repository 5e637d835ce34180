"""Borders between parts, displaced by known amounts."""

import numpy as np
import pytest
from surface_samples import cube, plate, score

from jointsdf.metrics.boundary import Boundary


@pytest.mark.parametrize(("shift", "expected"), [(0.0, 1.0), (0.005, 1.0), (0.015, 0.0), (0.1, 0.0)])
def test_displaced_border_counts_up_to_the_tolerance(shift, expected):
    assert score(Boundary(), plate(lambda _: 0.5 + shift), plate(lambda _: 0.5))["boundary_f1"] == expected


@pytest.mark.parametrize(("shift", "expected"), [(0.0015, 1.0), (0.006, 0.0)])
def test_the_fine_score_has_its_own_column_tolerance_and_ceiling(shift: float, expected: float) -> None:
    fine = Boundary(0.0005, 0.002, "boundary_f1_fine")
    found = score(fine, plate(lambda _: 0.5 + shift), plate(lambda _: 0.5))
    assert found == {"boundary_f1_fine": expected}
    assert (fine.ceilings, Boundary().ceilings) == (("boundary_f1_fine",), ("boundary_f1",))


def test_border_that_leaves_counts_by_length():
    away = plate(lambda y: np.where(y < 0.3, 0.5, 0.55))
    found = score(Boundary(), away, plate(lambda _: 0.5))["boundary_f1"]
    precision, recall = (0.3 + 0.01) / (1.0 + 0.05), 0.3 + 0.01  # the last 0.01: around the corner
    assert found == pytest.approx(2 * precision * recall / (precision + recall), abs=0.002)


def test_meshes_without_border():
    one, two = cube(labels=np.zeros(12, int)), cube(labels=np.arange(12) // 2)
    assert score(Boundary(), one, one)["boundary_f1"] == 1.0
    assert score(Boundary(), one, two)["boundary_f1"] == 0.0
    assert score(Boundary(), two, one)["boundary_f1"] == 0.0
