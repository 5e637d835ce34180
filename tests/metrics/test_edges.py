"""Creases displaced, chamfered, turned, invented and missed by known amounts, and their order by quality."""

import math

import numpy as np
import pytest
import trimesh
from analytic import box_distance
from labelled_meshes import EMPTY
from profiles import hinge, sheet
from scipy.spatial.transform import Rotation
from surface_samples import cube, labelled, score

from jointsdf.errors import InputError
from jointsdf.extraction.extractor import Extraction
from jointsdf.metrics.edges import COLUMNS, Edges
from jointsdf.values import LabelledMesh

TURN = Rotation.from_euler("xyz", [20, 35, 50], degrees=True)
HALF = 0.6  # of a turned cube's side in the training box


def edges(predicted: LabelledMesh, truth: LabelledMesh) -> dict[str, float]:
    return score(Edges(), predicted, truth, count=10)


@pytest.mark.parametrize("shift", [0.001, 0.003, 0.008])
def test_a_cube_moved_along_its_edges(shift: float) -> None:
    """Eight edges are displaced by the shift, four by nothing; at the corners these four pass the others."""
    found = edges(cube((0, 0, shift)), cube())
    for column, tolerance in (("edge_f1", 0.005), ("edge_f1_fine", 0.002)):
        expected = (4 - 4 * max(shift - tolerance, 0) + 8 * tolerance) / 12 if shift > tolerance else 1.0
        assert found[column] == pytest.approx(expected, abs=0.001)
    assert found["edge_cd"] == pytest.approx(100 * 8 * shift / 12, rel=0.01)
    assert (found["crease_angle_error"], found["crease_length_ratio"]) == pytest.approx((0, 1), abs=1e-6)
    assert found["false_crease_length"] == pytest.approx(12 * (1 - found["edge_f1"]), abs=1e-9)


@pytest.mark.parametrize(("predicted", "expected"), [(90, 0), (60, 30), (105, 15)])
def test_the_angle_of_a_hinge(predicted: float, expected: float) -> None:
    found = edges(hinge(predicted), hinge(90))
    assert found["crease_angle_error"] == pytest.approx(expected, abs=1e-6)
    assert (found["edge_f1_fine"], found["edge_cd"]) == pytest.approx((1, 0), abs=1e-6)


def test_a_chamfer_is_two_creases_of_half_the_angle_which_f1_alone_does_not_see() -> None:
    side = 0.004  # of the chamfer on either face; the old edge is at (side, 0)
    chamfer = sheet([(-1, 0), (0, 0), (side, side), (side, 1)])
    found = edges(chamfer, sheet([(-1, 0), (side, 0), (side, 1)]))
    assert (found["edge_f1"], found["edge_f1_fine"]) == (1, 0)
    assert found["edge_cd"] == pytest.approx(0.4, rel=1e-6)
    assert found["crease_length_ratio"] == pytest.approx(2)
    assert found["crease_angle_error"] == pytest.approx(45, abs=1e-6)


def test_false_and_missed_creases() -> None:
    stepped = sheet([(-1, 0), (0, 0), (0, 1), (1, 1)])
    found, missed = edges(stepped, hinge(90)), edges(hinge(90), stepped)
    assert (found["edge_f1"], found["crease_length_ratio"], found["false_crease_length"]) == pytest.approx(
        (2 / 3, 2, 1)
    )
    assert (missed["edge_f1"], missed["crease_length_ratio"], missed["false_crease_length"]) == pytest.approx(
        (2 / 3, 0.5, 0)
    )
    assert missed["edge_cd"] == pytest.approx(25, rel=0.001)  # one of two creases, at a distance of 1


def test_a_shape_without_crease_is_nan_but_for_the_length_of_those_invented() -> None:
    ball = labelled(trimesh.creation.icosphere(4, 0.5))
    noise = np.random.default_rng(0).normal(size=ball.vertices.shape) * 0.03
    rough = LabelledMesh(ball.vertices + noise, ball.faces, ball.labels)
    for predicted, invented in ((ball, False), (rough, True)):
        found = edges(predicted, ball)
        assert (found.pop("false_crease_length") > 1) == invented
        assert all(math.isnan(value) for value in found.values())
    smooth = edges(ball, cube())
    zero = {"edge_f1": 0, "edge_f1_fine": 0, "crease_length_ratio": 0, "false_crease_length": 0}
    assert {key: value for key, value in smooth.items() if not math.isnan(value)} == zero
    assert math.isnan(edges(EMPTY, ball)["false_crease_length"])


def test_noise_is_punished_by_precision() -> None:
    box = trimesh.creation.box((1, 1, 1)).subdivide_to_size(0.06)
    noise = np.random.default_rng(0).normal(size=box.vertices.shape)
    scores = [
        edges(LabelledMesh(box.vertices + size * noise, np.array(box.faces), np.zeros(len(box.faces), int)), cube())
        for size in (0.0, 0.0004, 0.012)
    ]
    assert [found["edge_f1"] > 0.99 for found in scores] == [True, True, False]
    assert scores[0]["crease_angle_error"] < scores[1]["crease_angle_error"] < 3 < scores[2]["crease_angle_error"]
    assert scores[2]["edge_f1"] < 0.2
    assert scores[2]["false_crease_length"] > 100


def turned_cube(radius: float, resolution: int) -> LabelledMesh:
    """Marching cubes of a turned cube, its edges rounded by a radius, in the cube's frame, longest side 1."""
    surface = Extraction(resolution).surface(
        lambda points: box_distance(TURN.apply(points), [HALF - radius] * 3) - radius
    )
    vertices = TURN.apply(surface.vertices) / (2 * HALF)
    return LabelledMesh(vertices, surface.faces, np.zeros(len(surface.faces), dtype=np.int64))


def test_exact_is_better_than_sharp_than_frayed_than_rounded() -> None:
    box = trimesh.creation.box((1, 1, 1)).subdivide_to_size(0.04)
    moved = np.array(box.vertices) + np.random.default_rng(0).uniform(-1, 1, box.vertices.shape) * 0.0005
    sharp = LabelledMesh(moved, np.array(box.faces), np.zeros(len(box.faces), int))
    found = [edges(mesh, cube()) for mesh in (cube(), sharp, turned_cube(0, 144), turned_cube(0.008 * 2 * HALF, 144))]
    for column in ("edge_cd", "crease_angle_error", "false_crease_length"):
        exact, near, frayed, rounded = (scores[column] for scores in found)
        assert exact <= near < frayed < rounded, column
    fine = [scores["edge_f1_fine"] for scores in found]
    assert fine[0] == fine[1] == 1
    assert 0.7 > fine[2] > 0.05 > fine[3]


def test_all_columns_have_a_ceiling() -> None:
    assert Edges().ceilings == COLUMNS
    assert edges(cube(), cube()).keys() == set(COLUMNS)


def test_lengths_out_of_range_are_refused() -> None:
    for name in ("spacing", "tolerance", "fine"):
        with pytest.raises(InputError, match=name):
            Edges(**{name: -1.0})
