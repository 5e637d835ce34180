"""Training clouds: points by area, by smooth region and near part borders, each with its share."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial import KDTree
from solids import distance_to_halves, halves, labelled

from jointsdf.data.point_cloud import Cloud, pool_points, region_areas
from jointsdf.data.sampler import Counts, Sampler
from jointsdf.geometry.mesh import face_areas


def test_steps_draw_their_share_near_borders_and_the_shell_from_the_uniform_points() -> None:
    cloud = Cloud.of(halves(), count=3000, seed=0, border_points=2000)
    assert cloud.uniform == 3000
    assert len(cloud.points) == 5000
    counts = Counts(manifold=1000, non_manifold=10, shell=10, pool=1, balanced=0.25, borders=0.5)
    near = set(map(tuple, cloud.points[3000:].astype(np.float32).tolist()))
    drawn = Sampler(cloud, np.zeros((0, 3)), np.zeros(0), counts, 0).draw(0)
    assert sum(tuple(point) in near for point in drawn.manifold.tolist()) == 500
    file_x = cloud.normalisation.inverse(drawn.manifold.double().numpy())[:, 0]
    clear = np.abs(file_x - 0.5) > 1e-5
    np.testing.assert_array_equal(drawn.labels.numpy()[clear], (file_x < 0.5)[clear])


def test_the_share_falls_to_the_uniform_points_where_there_is_no_border() -> None:
    cloud = Cloud.of(halves((4, 4)), count=500, seed=0, border_points=100)
    assert len(cloud.points) == 500
    counts = Counts(manifold=50, non_manifold=1, shell=1, pool=1, borders=1.0)
    assert len(Sampler(cloud, np.zeros((0, 3)), np.zeros(0), counts, 0).draw(0).manifold) == 50


def test_the_uniform_points_do_not_depend_on_the_border_points() -> None:
    plain, more = (Cloud.of(halves(), count=400, seed=0, border_points=number) for number in (0, 300))
    np.testing.assert_array_equal(plain.points, more.points[:400])
    part = Cloud.of(halves(), count=400, seed=0, border_points=300, label_fraction=0.1)
    assert (part.labels >= 0).sum() == 70
    assert replace(part, labels=more.labels).uniform == 400


def test_every_smooth_region_has_its_share_by_the_root_of_its_area() -> None:
    cloud = Cloud.of(halves(), count=100, seed=0, region_points=20_000, border_points=50)
    assert (cloud.uniform, cloud.regional, len(cloud.points)) == (100, 20_000, 20_150)
    points, normals = cloud.normalisation.inverse(cloud.points[100:20_100]), cloud.normals[100:20_100]
    np.testing.assert_allclose(distance_to_halves(points), 0, atol=1e-12)
    roots = np.sqrt([4, 8, 8])  # of a box of sides 4, 2, 2, the sides across x, y and z
    shares = [(np.abs(normals[:, axis]) > 0.5).mean() for axis in range(3)]
    np.testing.assert_allclose(shares, roots / roots.sum(), atol=0.01)
    np.testing.assert_array_equal(cloud.labels[100:20_100], points[:, 0] < 0.5)


def test_region_areas_of_a_cylinder_are_those_of_its_wall_and_its_caps() -> None:
    mesh = trimesh.creation.cylinder(radius=1.0, height=3.0, sections=64)
    cylinder = labelled(mesh)
    cap = 64 * np.sin(np.pi / 64) * np.cos(np.pi / 64)
    wall = 3 * 64 * 2 * np.sin(np.pi / 64)
    found = region_areas(cylinder, face_areas(cylinder))
    np.testing.assert_allclose(found, np.where(np.abs(mesh.face_normals[:, 2]) > 0.5, cap, wall))


def test_steps_and_pool_draw_from_the_regions() -> None:
    cloud = Cloud.of(halves(), count=3000, seed=0, region_points=1000, border_points=2000)
    counts = Counts(manifold=1000, non_manifold=10, shell=10, pool=1, balanced=0.25, regions=0.25, borders=0.5)
    drawn = Sampler(cloud, np.zeros((0, 3)), np.zeros(0), counts, 0).draw(0)
    places = {tuple(point): place for place, point in enumerate(cloud.points.astype(np.float32).tolist())}
    found = np.array([places[tuple(point)] for point in drawn.manifold.tolist()])
    assert [int(((found >= low) & (found < low + size)).sum()) for low, size in ((0, 3000), (3000, 1000))] == [250, 250]
    np.testing.assert_array_equal(drawn.normals.numpy(), cloud.normals[found].astype(np.float32))
    near = pool_points(cloud, count=4000, near_share=1.0, seed=0)
    nearest = KDTree(cloud.points[:4000]).query(near)[1]
    assert (nearest >= 3000).mean() == pytest.approx(0.25, abs=0.05)
    without = Cloud.of(halves(), count=3000, seed=0)
    assert (
        len(Sampler(without, np.zeros((0, 3)), np.zeros(0), replace(counts, borders=0.0), 0).draw(0).manifold) == 1000
    )


@pytest.mark.parametrize("scale", [1.0, 40.0])
def test_relative_area_of_the_cloud_of_a_box(scale: float) -> None:
    box = labelled(trimesh.creation.box(scale * np.array([4.0, 2.0, 1.0])))
    cloud = Cloud.of(box, count=30_000, seed=0, border_points=0)
    assert cloud.relative_area() == pytest.approx(2 * (8 + 4 + 2) / 4, rel=0.02)
