"""Normals and distances from points alone: exact on planes, right on either side of walls thinner than the gaps."""

import numpy as np
import pytest
import trimesh
from analytic import box_distance
from clouds import cloud_of

from jointsdf.data.point_cloud import Cloud
from jointsdf.data.streams import stream
from jointsdf.data.surfels import Surfels
from jointsdf.values import BOX


def surfels_of(cloud: Cloud) -> Surfels:
    return Surfels(cloud.points)


def near_points(cloud: Cloud, apart: float, count: int = 20000) -> np.ndarray:
    """Points beside those of the cloud, up to so far away along each axis."""
    generator = stream(1, 0)
    around = cloud.points[generator.integers(len(cloud.points), size=count)]
    return np.clip(around + generator.uniform(-apart, apart, (count, 3)), -BOX, BOX)


def test_sphere() -> None:
    cloud = cloud_of(trimesh.creation.icosphere(5, 0.7))
    surfels = surfels_of(cloud)
    centre, radius = cloud.normalisation.forward(np.zeros((1, 3))), 0.7 / cloud.normalisation.scale
    radial = (cloud.points - centre) / radius
    known = surfels.normals.any(axis=1)
    assert known.mean() > 0.9
    cosines = (surfels.normals * radial).sum(axis=1)[known]
    assert np.quantile(cosines, 0.01) > np.cos(np.radians(10))
    assert cosines.min() > 0
    points = near_points(cloud, 0.05)
    found, certain = surfels.signed(points)
    exact = np.linalg.norm(points - centre, axis=1) - radius
    assert certain.mean() > 0.95
    assert np.abs(found - exact)[certain].mean() < 5e-4
    wrong = certain & (np.sign(found) != np.sign(exact))
    assert wrong.mean() < 0.002
    assert np.abs(exact[wrong]).max() < surfels.radii.max() ** 2 / (2 * radius), "within what a disc cuts off the ball"
    assert (found[~certain] == 0).all()


@pytest.mark.parametrize("extents", [(2, 2, 1.2), (2, 2, 0.01), (2, 1.5, 0.004)], ids=["box", "plate", "foil"])
def test_box_of_any_thickness(extents: tuple[float, float, float]) -> None:
    """Foil is ten times as thin as the gaps between points are wide; free space alone knows no inside of it."""
    cloud = cloud_of(trimesh.creation.box(extents))
    surfels = surfels_of(cloud)
    known = surfels.normals.any(axis=1)
    assert known.mean() > (0.75 if extents[2] < 0.01 else 0.85)
    cosines = (surfels.normals * cloud.normals).sum(axis=1)[known]
    assert (cosines > 1 - 1e-6).mean() > 0.97
    assert (cosines > 0).mean() > 0.999
    assert (surfels.space.signs < 0).any() == (extents[2] > 1)
    half = np.array(extents) / 2 / cloud.normalisation.scale
    centre = cloud.normalisation.forward(np.zeros((1, 3)))[0]
    points = near_points(cloud, half[2] * 2 if half[2] < 0.1 else 0.05)
    exact = box_distance(points - centre, half)
    found, certain = surfels.signed(points)
    amid = certain & (np.abs(points - centre)[:, :2] < half[:2] - 0.1).all(axis=1)  # away from the four sides
    assert certain.mean() > 0.75
    assert (found[amid] < 0).mean() == pytest.approx((exact[amid] < 0).mean(), abs=0.05)
    assert (np.sign(found) == np.sign(exact))[amid].mean() > 0.95
    assert np.median(np.abs(found - exact)[amid]) < 1e-6
    assert (np.sign(found) == np.sign(exact))[certain].mean() > 0.95


def test_the_sides_of_a_narrow_slot_face_each_other() -> None:
    """Two slabs 0.012 apart: no free space between them, but the slabs themselves are thick enough."""
    slabs = [trimesh.creation.box((2, 2, 0.5)).apply_translation((0, 0, side * 0.256)) for side in (-1, 1)]
    cloud = cloud_of(trimesh.util.concatenate(slabs))
    surfels = surfels_of(cloud)
    slot = np.abs(cloud.points[:, 2] - cloud.normalisation.forward(np.zeros((1, 3)))[0, 2]) < 0.01
    known = slot & surfels.normals.any(axis=1)
    assert known.sum() > 0.6 * slot.sum()
    assert ((surfels.normals * cloud.normals).sum(axis=1)[known] > 0).mean() > 0.998


def test_scattered_points_have_no_normals_and_no_signs() -> None:
    scattered = stream(3, 0).uniform(-0.9, 0.9, (5000, 3))
    surfels = Surfels(scattered)
    assert surfels.normals.any(axis=1).mean() < 0.02
    assert surfels.signed(stream(4, 0).uniform(-0.8, 0.8, (2000, 3)))[1].mean() < 0.02


@pytest.mark.parametrize("kind", ["rod", "copies"])
def test_points_on_a_line_or_on_one_another_have_no_normal(kind: str) -> None:
    """A line lies in any plane around it."""
    if kind == "rod":
        points = cloud_of(trimesh.creation.box((2, 5e-4, 5e-4)), 1000).points
    else:
        points = np.repeat(cloud_of(trimesh.creation.icosphere(3, 0.7), 400).points, 17, axis=0)
    surfels = Surfels(points)
    assert not surfels.normals.any()
    if kind == "rod":
        distances, certain = surfels.signed(near_points(cloud_of(trimesh.creation.icosphere(3, 0.7), 400), 0.1))
        assert (distances[certain] > 0).all(), "nothing is inside a line"
        assert certain.mean() > 0.5
    assert np.isfinite(surfels.signed(near_points(cloud_of(trimesh.creation.icosphere(3, 0.7), 400), 0.1))[0]).all()


@pytest.mark.parametrize("count", [2, 3, 5, 12, 17, 25])
def test_too_few_points_have_no_normals_and_no_signs(count: int) -> None:
    """Every side is in doubt: no normal, no distance, and no error."""
    points = cloud_of(trimesh.creation.icosphere(3, 0.7), count).points
    surfels = Surfels(points)
    distances, certain = surfels.signed(np.zeros((0, 3)))
    assert distances.shape == certain.shape == (0,)
    assert not surfels.normals.any()
    distances, certain = surfels.signed(stream(4, 0).uniform(-1, 1, (500, 3)))
    assert not certain.any()
    assert not distances.any()


@pytest.mark.parametrize("thickness", [0.01, 0.02])
def test_beyond_the_rim_of_a_thin_wall_next_to_no_sign_is_wrong(thickness: float) -> None:
    """The planes of the wall agree on its inside there; it is known that they do not say it of places beside it."""
    extents = np.array([2, 2, thickness])
    cloud = cloud_of(trimesh.creation.box(extents))
    half, centre = extents / 2 / cloud.normalisation.scale, cloud.normalisation.forward(np.zeros((1, 3)))[0]
    offsets = stream(1, 0).uniform(-1, 1, (20000, 3)) * (half + np.array([0.06, 0.06, 0.03]))
    beyond = (np.abs(offsets[:, :2]) > half[:2]).any(axis=1) & (np.abs(offsets + centre) < BOX).all(axis=1)
    found, known = surfels_of(cloud).signed(offsets[beyond] + centre)
    assert beyond.sum() > 1000
    assert known.mean() > 0.45
    assert (found[known] < 0).mean() < 0.003, "a tenth without"
