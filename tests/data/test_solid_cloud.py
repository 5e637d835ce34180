"""Sides by the winding number: those of free space where they are right, right where pieces are missing."""

import numpy as np
import pytest
import trimesh
from clouds import cloud_of
from scipy.spatial import KDTree

from jointsdf.data.solid_cloud import SolidCloud
from jointsdf.data.surfels import Surfels
from jointsdf.data.winding_field import WindingField
from jointsdf.values import BOX

RADIUS = 0.8


def ball(count: int = 12000, *, missing: float = 0.0) -> np.ndarray:
    """Points on a sphere about the origin, without a cap at the top."""
    points = np.random.default_rng(0).normal(size=(count, 3))
    points *= RADIUS / np.linalg.norm(points, axis=1, keepdims=True)
    return points[points[:, 2] < RADIUS * (1 - 2 * missing)]


@pytest.mark.parametrize("count", [500, 12000])
def test_the_winding_number_of_a_ball(count: int) -> None:
    points = ball(count)
    spacing = np.sqrt(4 * np.pi * RADIUS**2 / count)
    field = WindingField(points, spacing)
    values = field.solve(spacing**2 * points / RADIUS)
    places = np.random.default_rng(1).uniform(-BOX, BOX, (5000, 3))
    height = np.linalg.norm(places, axis=1) - RADIUS
    clear = np.abs(height) > 2 * spacing + 2 * field.cell
    assert field.at(values, places)[clear] == pytest.approx((height < 0)[clear].astype(float), abs=0.1)
    assert np.abs(field.at(values, places) - (height < 0))[clear].mean() < 0.02


def test_sides_that_free_space_leaves_in_doubt_are_found() -> None:
    generator, points = np.random.default_rng(2), ball()
    planes = points / RADIUS * generator.choice([-1.0, 1.0], (len(points), 1))
    right = np.sign((planes * points).sum(axis=1))
    told = SolidCloud(points, planes, right * (generator.random(len(points)) < 0.3), KDTree(points)).signs
    assert (told == right).mean() > 0.99
    assert (told != -right).all()


def test_a_patch_that_is_told_wrong_is_turned() -> None:
    points = ball()
    told = SolidCloud(points, points / RADIUS, np.where(points[:, 0] > 0.97 * RADIUS, -1.0, 1.0), KDTree(points)).signs
    assert (told == 1).all()


def test_a_wall_too_thin_for_the_grid_keeps_the_sides_of_free_space() -> None:
    cloud = cloud_of(trimesh.creation.box((2, 2, 0.01)))
    assert np.array_equal(Surfels(cloud.points, solid=True).normals, Surfels(cloud.points).normals)


def test_what_is_missing_of_a_ball_is_closed() -> None:
    points = ball(missing=0.1)
    middle = np.zeros((1, 3))
    assert Surfels(points).signed(middle)[0] > 0, "free space leaks in"
    surfels = Surfels(points, solid=True)
    known = surfels.normals[: len(points)].any(axis=1)
    assert known.mean() > 0.95
    assert ((surfels.normals[: len(points)] * points).sum(axis=1)[known] > 0).all()
    cover, normals = surfels.points[len(points) :], surfels.normals[len(points) :]
    rim, top = np.sqrt(0.36) * RADIUS, 0.8 * RADIUS
    assert len(cover) > 100
    assert np.abs(cover[:, 2] - top).max() < 0.25 * RADIUS
    assert np.hypot(cover[:, 0], cover[:, 1]).max() < 1.1 * rim
    assert (normals[:, 2] > 0.5).all()
    places = np.random.default_rng(1).uniform(-BOX, BOX, (5000, 3))
    exact = np.linalg.norm(places, axis=1) - RADIUS
    found, certain = surfels.signed(places)
    judged = certain & (np.abs(places[:, 2]) < 0.5 * RADIUS) & (np.abs(exact) > 0.05)
    assert judged.sum() > 1000
    assert (np.sign(found) == np.sign(exact))[judged].all()
    (distance,), (said,) = surfels.signed(middle)
    assert said
    assert distance == pytest.approx(-top, rel=0.05), "to the cover, which is flat"


def test_a_whole_cloud_is_as_without() -> None:
    cloud = cloud_of(trimesh.creation.box((2, 1.5, 1)))
    closed, plain = Surfels(cloud.points, solid=True), Surfels(cloud.points)
    assert np.array_equal(closed.points, cloud.points)
    known = plain.normals.any(axis=1)
    assert np.array_equal(closed.normals[known], plain.normals[known])
    assert closed.normals.any(axis=1).mean() >= known.mean()
