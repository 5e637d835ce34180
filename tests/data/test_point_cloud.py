"""The training cloud on an analytic surface, its labels, and the pool about it."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial import KDTree
from scipy.stats import kstest
from solids import distance_to_halves, halves, labelled

from jointsdf.data.point_cloud import Cloud, draw_pool, region_areas
from jointsdf.data.sampler import Counts, Sampler
from jointsdf.data.streams import stream
from jointsdf.geometry.mesh import face_areas
from jointsdf.values import BOX, LabelledMesh


def test_streams_are_their_own() -> None:
    draws = [
        stream(*key).random(4).tolist() for key in ((0, 0), (0, 1), (1, 0), (0, 1, 2), (0, 3, 0), (0, 3, 1), (0, 3, 2))
    ]
    assert len({tuple(draw) for draw in draws}) == 7
    assert stream(5, 3, 17).random(4).tolist() == stream(5, 3, 17).random(4).tolist()


def test_cloud_is_normalised_by_its_mean_and_largest_coordinate(box: LabelledMesh) -> None:
    cloud = Cloud.of(box, count=3000, seed=0)
    np.testing.assert_allclose(cloud.points.mean(axis=0), 0, atol=1e-12)
    assert np.abs(cloud.points).max() == pytest.approx(1, abs=1e-12)


def test_cloud_lies_on_the_box_with_its_normals_and_parts(
    box: LabelledMesh, box_distance: Callable[[np.ndarray], np.ndarray]
) -> None:
    cloud = Cloud.of(box, count=3000, seed=0)
    points = cloud.normalisation.inverse(cloud.points)
    np.testing.assert_allclose(box_distance(points), 0, atol=1e-9)
    np.testing.assert_allclose(cloud.normalisation.forward(points), cloud.points, atol=1e-12)
    np.testing.assert_allclose(box_distance(points + 0.5 * cloud.normals), 0.5, atol=1e-9)  # they point outward
    np.testing.assert_array_equal(cloud.part_ids, [3, 7, 12, 40])
    x, z = cloud.normals[:, 0], cloud.normals[:, 2]
    expected = np.select([x > 0.5, x < -0.5, z > 0.5], [3, 7, 12], 40)
    np.testing.assert_array_equal(cloud.part_ids[cloud.labels], expected)


def test_cloud_depends_on_the_seed_alone(box: LabelledMesh) -> None:
    first, again, other = (Cloud.of(box, count=500, seed=seed).points for seed in (3, 3, 4))
    np.testing.assert_array_equal(first, again)
    assert not np.isclose(first, other).any(axis=1).all()


@pytest.mark.parametrize(("fraction", "kept"), [(0.0, 0), (0.1, 200), (0.5, 1000), (1.0, 2000)])
def test_label_fraction_keeps_that_share(box: LabelledMesh, fraction: float, kept: int) -> None:
    whole, part = (Cloud.of(box, count=2000, seed=0, label_fraction=share) for share in (1.0, fraction))
    labelled = part.labels != -1
    assert labelled.sum() == kept
    np.testing.assert_array_equal(part.labels[labelled], whole.labels[labelled])
    np.testing.assert_array_equal(part.points, whole.points)
    np.testing.assert_array_equal(part.part_ids, whole.part_ids)


def test_unlabelled_faces_give_unlabelled_points(box: LabelledMesh) -> None:
    mesh = replace(box, labels=np.where(box.labels == 7, -1, box.labels))
    cloud = Cloud.of(mesh, count=2000, seed=0)
    np.testing.assert_array_equal(cloud.part_ids, [3, 12, 40])
    np.testing.assert_array_equal(cloud.labels == -1, cloud.normals[:, 0] < -0.5)
    unlabelled = Cloud.of(replace(box, labels=np.full(len(box.faces), -1)), count=2000, seed=0)
    assert (unlabelled.labels == -1).all()
    assert len(unlabelled.part_ids) == 0


def test_pool_is_near_the_surface_and_everywhere(
    box: LabelledMesh, box_distance: Callable[[np.ndarray], np.ndarray]
) -> None:
    cloud = Cloud.of(box, count=5000, seed=0)
    points = draw_pool(cloud, count=10001, near_share=0.5, seed=0)
    assert points.shape == (10001, 3)
    assert np.abs(points).max() <= BOX
    near, far = points[:5000], points[5000:]
    distances = np.abs(box_distance(cloud.normalisation.inverse(near))) / cloud.normalisation.scale
    assert np.quantile(distances, 0.9) < 0.1
    for low, high in ((0, 2e-3), (2e-3, 2e-2), (2e-2, 0.4)):  # every scale is met
        assert ((distances >= low) & (distances < high)).mean() > 0.1
    for axis in range(3):
        assert kstest(far[1::2, axis], "uniform", (-BOX, 2 * BOX)).pvalue > 0.01
        assert kstest(far[::2, axis], "arcsine", (-BOX, 2 * BOX)).pvalue > 0.01


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
    near = draw_pool(cloud, count=4000, near_share=1.0, seed=0)
    nearest = KDTree(cloud.points[:4000]).query(near)[1]
    assert (nearest >= 3000).mean() == pytest.approx(0.25, abs=0.05)
    without = Cloud.of(halves(), count=3000, seed=0)
    assert (
        len(Sampler(without, np.zeros((0, 3)), np.zeros(0), replace(counts, borders=0.0), 0).draw(0).manifold) == 1000
    )


def test_steps_draw_beside_creases_and_the_other_points_stay_as_they_were() -> None:
    sizes = {"count": 3000, "seed": 0, "region_points": 1000, "border_points": 2000}
    plain, cloud = (Cloud.of(halves(), crease_points=number, **sizes) for number in (0, 500))
    assert (plain.creased, cloud.creased, len(cloud.points)) == (0, 500, 6500)
    np.testing.assert_array_equal(np.delete(cloud.points, np.s_[4000:4500], axis=0), plain.points)
    points = cloud.normalisation.inverse(cloud.points[4000:4500])
    np.testing.assert_array_equal(cloud.labels[4000:4500], points[:, 0] < 0.5)
    inward = np.sort([2, 1, 1] - np.abs(points - [0.5, 0, 0]), axis=1)[:, 1]
    assert 0.002 < np.median(inward) < inward.max() <= 0.016
    counts = Counts(manifold=1000, non_manifold=1, shell=1, pool=1, balanced=0.2, regions=0.2, creases=0.3, borders=0.2)
    drawn = Sampler(cloud, np.zeros((0, 3)), np.zeros(0), counts, 0).draw(0)
    places = {tuple(point): place for place, point in enumerate(cloud.points.astype(np.float32).tolist())}
    found = np.searchsorted([3000, 4000, 4500], [places[tuple(point)] for point in drawn.manifold.tolist()], "right")
    np.testing.assert_array_equal(np.bincount(found), [300, 200, 300, 200])


def test_shares_that_round_up_leave_the_last_of_them_fewer_points() -> None:
    cloud = Cloud.of(halves(), count=300, seed=0, region_points=100, crease_points=100)
    counts = Counts(manifold=7, non_manifold=1, shell=1, pool=1, regions=0.5, creases=0.5)
    drawn = Sampler(cloud, np.zeros((0, 3)), np.zeros(0), counts, 0).draw(0)
    assert len(drawn.manifold) == 7


@pytest.mark.parametrize("scale", [1.0, 40.0])
def test_relative_area_of_the_cloud_of_a_box(scale: float) -> None:
    box = labelled(trimesh.creation.box(scale * np.array([4.0, 2.0, 1.0])))
    cloud = Cloud.of(box, count=30_000, seed=0, border_points=0)
    assert cloud.relative_area() == pytest.approx(2 * (8 + 4 + 2) / 4, rel=0.02)


def test_every_part_has_as_many_points_as_any_other() -> None:
    cloud = Cloud.of(halves(), count=100, seed=0, region_points=300, part_points=2001, border_points=50)
    assert (cloud.uniform, cloud.regional, cloud.of_parts, len(cloud.points)) == (100, 300, 2000, 2450)
    points = cloud.normalisation.inverse(cloud.points[cloud.part_points])
    np.testing.assert_allclose(distance_to_halves(points), 0, atol=1e-12)
    np.testing.assert_array_equal(cloud.labels[cloud.part_points], np.repeat([0, 1], 1000))
    np.testing.assert_array_equal(cloud.labels[cloud.part_points], points[:, 0] < 0.5)
    near = cloud.normalisation.inverse(cloud.points[cloud.border_points])
    assert len(near) == 50
    assert np.abs(near[:, 0] - 0.5).max() < 0.5


def test_judges_are_points_of_all_parts() -> None:
    cloud = Cloud.of(halves(), count=100, seed=0, part_points=40_000, region_points=300, border_points=50)
    judging = cloud.judging()
    assert (cloud.part_points.start, cloud.part_points.stop) == (400, 40_400)
    assert ((judging >= 400) & (judging < 40_400)).all()
    np.testing.assert_array_equal(np.bincount(cloud.labels[judging]), [5000, 5000])
    assert len(Cloud.of(halves(), count=100, seed=0, part_points=4000).judging()) == 0
    assert len(Cloud.of(halves(), count=100, seed=0).judging()) == 0


def test_a_mesh_without_labels_has_no_points_of_parts() -> None:
    mesh = replace(halves(), labels=np.full(len(halves().labels), -1))
    cloud = Cloud.of(mesh, count=100, seed=0, part_points=100)
    assert (cloud.of_parts, len(cloud.points)) == (0, 100)
