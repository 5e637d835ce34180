"""Normals beside the crease of a hinge, of which a chamfer is cut off: the share that it turns is known."""

import math

import numpy as np
import pytest
import trimesh
from labelled_meshes import EMPTY
from profiles import hinge, sheet
from surface_samples import cube, labelled, score

from jointsdf.errors import InputError
from jointsdf.metrics.crease_normals import CreaseNormals
from jointsdf.values import LabelledMesh

ARM, WIDTH, CUT = 0.02, 0.01, 0.004


def chamfered(cut: float) -> LabelledMesh:
    return sheet([(-ARM, 0), (-cut, 0), (0, cut), (0, ARM)], 0.1)


def near_creases(predicted: LabelledMesh, truth: LabelledMesh) -> float:
    return score(CreaseNormals(WIDTH), predicted, truth, count=20_000)["crease_nc"]


def test_a_chamfer_by_hand() -> None:
    chamfer, flat, cosine = CUT * math.sqrt(2), 2 * (WIDTH - CUT), math.sqrt(0.5)
    of_predicted = (flat + chamfer * cosine) / (flat + chamfer)
    of_truth = (flat + 2 * CUT * cosine) / (2 * WIDTH)  # closest to the chamfer are the points that it cut off
    found = near_creases(chamfered(CUT), hinge(90, ARM, 0.1))
    assert found == pytest.approx((of_predicted + of_truth) / 2, abs=0.005)
    assert found < near_creases(chamfered(CUT / 2), hinge(90, ARM, 0.1)) < 1


@pytest.mark.parametrize("shift", [-0.002, 0.002])
def test_a_sharp_edge_in_another_place_keeps_its_normals(shift: float) -> None:
    """Beyond an edge all points are closest to the edge itself, of which the better side counts."""
    moved = sheet([(-ARM, shift), (-shift, shift), (-shift, ARM)], 0.1)
    assert near_creases(moved, hinge(90, ARM, 0.1)) == pytest.approx(1, abs=1e-9)


def test_normals_away_from_creases_do_not_count() -> None:
    box = trimesh.creation.box((1, 1, 1)).subdivide_to_size(0.05)
    inner = np.abs(box.vertices).max(axis=1) == 0.5
    inner &= np.sort(np.abs(box.vertices), axis=1)[:, 1] < 0.4
    noise = np.random.default_rng(0).normal(size=box.vertices.shape) * 0.01 * inner[:, None]
    rough = LabelledMesh(box.vertices + noise, np.array(box.faces), np.zeros(len(box.faces), int))
    assert near_creases(rough, cube()) == pytest.approx(1, abs=1e-9)


def test_nothing_near_a_crease_is_nan() -> None:
    ball = labelled(trimesh.creation.icosphere(3, 0.5))
    far = cube((5.0, 0, 0))
    assert all(math.isnan(near_creases(*pair)) for pair in ((ball, ball), (EMPTY, cube()), (far, cube())))
    with pytest.raises(InputError, match="width"):
        CreaseNormals(-0.1)
