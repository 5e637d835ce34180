"""Distances between surfaces of known distance."""

import pytest
import trimesh
from surface_samples import cube, labelled, score

from jointsdf.metrics.surface_distance import SurfaceDistance


def test_shifted_cube_has_the_integrated_distance():
    shift = 0.1
    found = score(SurfaceDistance(), cube(shift=(shift, 0, 0)), cube(), count=40_000)
    # Outer end: shift. Inner end: the nearest of shift and four sides. Sides: a strip that sticks out by 0..shift.
    mean = (shift + (1 - (1 - 2 * shift) ** 3) / 6 + 4 * shift**2 / 2) / 6
    assert found["surface_mean"] == pytest.approx(mean, rel=0.02)
    assert found["surface_p99"] == pytest.approx(shift, rel=1e-9)
    assert found["surface_max"] == pytest.approx(shift, rel=1e-9)


def test_surface_distance_is_free_of_sampling_noise_and_sees_a_far_sheet_on_either_side():
    far = trimesh.util.concatenate(
        [trimesh.creation.box(), trimesh.creation.box(extents=(0.1, 0.1, 0.1)).apply_translation((5, 0, 0))]
    )
    assert score(SurfaceDistance(), cube(), cube())["surface_max"] == pytest.approx(0.0, abs=1e-12)
    for pair in ((labelled(far), cube()), (cube(), labelled(far))):
        assert score(SurfaceDistance(), *pair, count=20_000)["surface_max"] == pytest.approx(4.55, rel=1e-3)
