"""Normal consistency against a loop."""

import numpy as np
import pytest
from surface_samples import cloud, directions

from jointsdf.errors import InputError
from jointsdf.metrics.normal_consistency import NormalConsistency


@pytest.mark.parametrize("form", ["cosine", "axes"])
def test_normal_consistency_equals_a_loop(clouds, form):
    predicted, truth = clouds

    def one_way(first, second):
        total = 0.0
        for point, normal in zip(first.points, first.normals, strict=True):
            other = second.normals[np.argmin(((second.points - point) ** 2).sum(axis=1))]
            total += (
                abs(normal @ other) if form == "cosine" else sum(abs(a * b) for a, b in zip(normal, other, strict=True))
            )
        return total / len(first.points)

    expected = (one_way(predicted, truth) + one_way(truth, predicted)) / 2
    assert NormalConsistency(form=form)(predicted, truth)["nc"] == pytest.approx(expected, rel=1e-12)


def test_axes_form_exceeds_the_cosine_of_crossed_normals():
    first, second = np.array([[0.6, 0.8, 0.0]]), np.array([[0.8, -0.6, 0.0]])
    predicted, truth = cloud([[0, 0, 0]], normals=first), cloud([[0, 0, 0]], normals=second)
    assert NormalConsistency(form="cosine")(predicted, truth)["nc"] == pytest.approx(0.0, abs=1e-15)
    assert NormalConsistency(form="axes")(predicted, truth)["nc"] == pytest.approx(0.96)


def test_normals_of_concentric_spheres_agree_whichever_way_they_point():
    rays = directions(np.random.default_rng(0), 500)
    predicted, truth = cloud(0.45 * rays, normals=-rays), cloud(0.5 * rays, normals=rays)
    assert NormalConsistency()(predicted, truth)["nc"] == pytest.approx(1.0, rel=1e-12)


def test_unknown_form_is_refused():
    with pytest.raises(InputError, match=r"'angle'.*cosine, axes"):
        NormalConsistency(form="angle")
