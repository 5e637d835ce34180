"""Planes that are displaced, wavy, bounded by bad edges, or none."""

import math

import numpy as np
import pytest
import trimesh
from labelled_meshes import EMPTY
from profiles import hinge, sheet
from surface_samples import cube, labelled, score

from jointsdf.evaluation.protocol import sample_surface
from jointsdf.metrics.flatness import Flatness, find_planes
from jointsdf.values import LabelledMesh


def flatness(predicted: LabelledMesh, truth: LabelledMesh) -> float:
    return score(Flatness(), predicted, truth, count=20_000)["flatness"]


@pytest.mark.parametrize("shift", [0.0, 1e-4, 0.01])
def test_a_plane_displaced_is_its_displacement_away(shift: float) -> None:
    assert flatness(cube((0, 0, shift)), cube()) == pytest.approx(shift, abs=1e-9)


def test_a_wave_has_the_percentile_of_a_sine() -> None:
    x = np.linspace(0, 1, 801)
    wavy = sheet(np.stack([x, 0.003 * np.sin(20 * np.pi * x)], axis=1))
    assert flatness(wavy, sheet([(0, 0), (1, 0)])) == pytest.approx(0.003 * math.sin(0.99 * math.pi / 2), rel=0.01)


def test_what_is_wrong_at_a_crease_does_not_count() -> None:
    frayed = sheet([(-1, 0), (-0.004, 0), (0, 0.004), (0, 1)])
    assert flatness(frayed, hinge(90)) == pytest.approx(0, abs=1e-9)


def test_patches_are_planes_of_an_area_not_facets() -> None:
    """A cylinder of 200 facets has two; one of 12, whose facets have 3% of the area each, has 14; a ball none."""
    solids = trimesh.creation.cylinder(0.5, 1.0, sections=200), trimesh.creation.cylinder(0.5, 1.0, sections=12)
    counts = [len(find_planes(sample_surface(labelled(solid), 10, 0)).offsets) for solid in solids]
    assert counts == [2, 14]
    planes = find_planes(sample_surface(cube(), 10, 0))
    np.testing.assert_allclose(np.sort(planes.normals @ [1, 2, 3]), [-3, -2, -1, 1, 2, 3], atol=1e-12)
    np.testing.assert_allclose(planes.offsets, 0.5)
    assert (np.bincount(planes.patch) == 2).all()
    shrunk = labelled(trimesh.creation.cylinder(0.498, 1.0, sections=200))
    assert flatness(shrunk, labelled(solids[0])) == pytest.approx(0, abs=1e-9)


def test_without_a_plane_or_a_prediction_it_is_nan() -> None:
    ball = labelled(trimesh.creation.icosphere(3, 0.5))
    assert math.isnan(flatness(ball, ball))
    assert math.isnan(flatness(EMPTY, cube()))
