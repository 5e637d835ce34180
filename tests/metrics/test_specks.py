"""Small pieces that nothing of the truth is near."""

import math

import numpy as np
import pytest
import trimesh
from surface_samples import cube, labelled, score

from jointsdf.errors import InputError
from jointsdf.evaluation.protocol import bounding_frame, sample_surface
from jointsdf.metrics.specks import Specks
from jointsdf.values import LabelledMesh


def with_balls(*balls: tuple[float, tuple[float, float, float]]) -> LabelledMesh:
    """The unit cube about the origin and balls of a diameter at a place."""
    parts = [trimesh.creation.box((1, 1, 1))]
    parts += [
        trimesh.creation.icosphere(subdivisions=2, radius=size / 2).apply_translation(place) for size, place in balls
    ]
    return labelled(trimesh.util.concatenate(parts))


@pytest.mark.parametrize(
    ("balls", "specks"),
    [
        ((), 0),
        (((0.002, (0, 0, 0)),), 1),  # within the solid
        (((0.002, (0.505, 0, 0)),), 1),  # outside
        (((0.002, (0.502, 0, 0)),), 0),  # nearer than its size: a crumb
        (((0.002, (0.5, 0.5, 0.5)),), 0),  # across a corner
        (((0.0029, (0, 0, 0.2)), (0.0031, (0, 0, -0.2)), (0.001, (0, 0.51, 0))), 2),  # one is too large
    ],
)
@pytest.mark.parametrize("scale", [1.0, 250.0])
def test_pieces_far_from_the_truth_and_small_are_specks(balls, specks, scale):
    truth, predicted = labelled(trimesh.creation.box((1, 1, 1))), with_balls(*balls)
    scaled = [LabelledMesh(mesh.vertices * scale, mesh.faces, mesh.labels) for mesh in (predicted, truth)]
    samples = [sample_surface(mesh, 100, 0, bounding_frame(scaled[1])) for mesh in scaled]
    assert Specks()(*samples) == {"specks": specks}


def test_nothing_has_no_specks_and_size_is_a_length():
    empty = LabelledMesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64), np.zeros(0, dtype=np.int64))
    assert score(Specks(), empty, cube()) == {"specks": 0.0}
    assert math.isnan(score(Specks(), cube(), empty)["specks"])
    with pytest.raises(InputError, match=r"specks\.size"):
        Specks(size=-1.0)
