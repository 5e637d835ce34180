"""Scores by held-out points against surfaces whose distances are known."""

from dataclasses import replace

import numpy as np
import pytest
from cloud_files import on_box
from scipy.spatial import KDTree
from solids import halves

from jointsdf.data.held_out import mark_held_out
from jointsdf.evaluation.held_out import held_out_scores
from jointsdf.shapes.clouds.sources import load_cloud
from jointsdf.values import LabelledMesh, Scan

BOX, MESH = on_box(8000), halves()
LENGTHS = ("held_out_mean", "held_out_p99", "to_cloud_mean", "to_cloud_p99")


@pytest.fixture(scope="module")
def scan() -> Scan:
    return load_cloud(points=BOX.points, labels=BOX.labels, name="scan")


def test_the_true_surface_scores_best(scan: Scan) -> None:
    scores = held_out_scores(scan, MESH)
    assert scores["held_out_mean"] == pytest.approx(0, abs=1e-9)
    assert scores["held_out_p99"] == pytest.approx(0, abs=1e-9)
    assert (scores["held_out_acc"], scores["held_out_miou"]) == (1, 1)
    assert (scores["components"], scores["euler"], scores["parts_pred"], scores["uncovered"]) == (1, 2, 2, 0)
    # from a random place of a plane of density rho the nearest point is at 0.5 / sqrt(rho) in the mean
    assert scores["to_cloud_mean"] * scan.side == pytest.approx(0.5 * np.sqrt(40 / 8000), rel=0.05)


def test_distances_are_those_of_the_held_out_points_in_shares_of_the_longest_side(scan: Scan) -> None:
    moved = replace(MESH, vertices=MESH.vertices + np.array([0, 0, 0.1]))
    scores = held_out_scores(scan, moved)
    held = scan.points[mark_held_out(scan.points)]
    inside = np.abs(held - [0.5, 0, 0.1]) - [2, 1, 1]
    expected = np.where((inside <= 0).all(axis=1), -inside.max(axis=1), np.linalg.norm(np.maximum(inside, 0), axis=1))
    assert scores["held_out_mean"] * scan.side == pytest.approx(expected.mean(), rel=1e-6)
    assert scores["held_out_p99"] * scan.side == pytest.approx(np.quantile(expected, 0.99), rel=1e-6)
    large = load_cloud(points=1000 * BOX.points, labels=BOX.labels)
    scaled = held_out_scores(large, replace(moved, vertices=1000 * moved.vertices))
    assert scaled == pytest.approx(scores, rel=1e-9)


def test_area_that_the_cloud_does_not_cover_counts(scan: Scan) -> None:
    half = scan.points[:, 0] < 0.5
    cut = load_cloud(points=scan.points[half], name="half")
    scores = held_out_scores(cut, MESH)
    assert scores["uncovered"] == pytest.approx(0.5, abs=0.05)
    away = KDTree(cut.points).query(np.array([[2.5, 0, 0]]))[0][0]
    assert scores["to_cloud_p99"] * cut.side <= 1.05 * away
    assert np.isnan([scores["held_out_acc"], scores["held_out_miou"], scores["parts_pred"]]).all()


def test_wrong_labels_count_at_held_out_points(scan: Scan) -> None:
    swapped = held_out_scores(scan, halves((9, 4)))
    assert (swapped["held_out_acc"], swapped["held_out_miou"]) == (0, 0)
    one = held_out_scores(scan, replace(MESH, labels=np.full(len(MESH.labels), 4)))
    share = (scan.labels[mark_held_out(scan.points)] == 4).mean()
    assert one["held_out_acc"] == pytest.approx(share)
    assert one["held_out_miou"] == pytest.approx(share / 2)


def test_an_empty_mesh_has_no_distances_and_no_right_label(scan: Scan) -> None:
    empty = LabelledMesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64), np.zeros(0, dtype=np.int64))
    scores = held_out_scores(scan, empty)
    assert all(np.isnan(scores[name]) for name in (*LENGTHS, "uncovered"))
    assert (scores["components"], scores["parts_pred"], scores["held_out_acc"]) == (0, 0, 0)
