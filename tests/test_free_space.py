"""Signs from points alone: never wrong where they are given, given wherever walls are thick enough."""

import numpy as np
import pytest
import trimesh

from jointsdf.cloud import Cloud, stream
from jointsdf.data import ShapeDataModule, network_distance
from jointsdf.free_space import FINEST, FreeSpace
from jointsdf.sampling import Counts
from jointsdf.values import BOX, InputError, LabelledMesh, Shape


def cloud_of(solid: trimesh.Trimesh, count: int = 20000) -> Cloud:
    mesh = LabelledMesh(np.array(solid.vertices), np.array(solid.faces), np.zeros(len(solid.faces), dtype=np.int64))
    return Cloud.of(mesh, count=count, seed=0)


def probes(count: int = 40000) -> np.ndarray:
    return stream(1, 0).uniform(-BOX, BOX, (count, 3))


def test_distance_to_a_sphere() -> None:
    cloud = cloud_of(trimesh.creation.icosphere(5, 0.7))
    space, points = FreeSpace(cloud.points), probes()
    found, known = space.signed(points)
    expected = np.linalg.norm(points - cloud.normalisation.forward(np.zeros((1, 3))), axis=1)
    expected -= 0.7 / cloud.normalisation.scale
    assert 0.01 < space.reach < 0.1
    assert known[np.abs(expected) > 1.5 * space.reach].all()
    assert not known[np.abs(expected) < 0.5 * space.reach].any()
    np.testing.assert_allclose(found[known], expected[known], atol=0.02)
    assert (found[~known] == 0).all()


@pytest.mark.parametrize("thickness", [0.02, 0.5])
def test_a_plate_is_outside_on_both_sides_and_inside_only_where_it_is_thick(thickness: float) -> None:
    cloud = cloud_of(trimesh.creation.box((2, 2, thickness)))
    found, known = FreeSpace(cloud.points).signed(probes())
    inside = np.abs(probes()[:, 2]) < thickness / 2 / cloud.normalisation.scale
    assert ((found < 0) <= inside).all()
    assert (found[known & ~inside] > 0).all()
    assert (found < 0).any() == (thickness > 0.1)


def test_a_tube_is_outside_within() -> None:
    cloud = cloud_of(trimesh.creation.annulus(0.4, 0.6, 2.0))
    axis = np.stack([np.zeros(50), np.zeros(50), np.linspace(-1, 1, 50)], axis=1)
    found, known = FreeSpace(cloud.points).signed(axis)
    assert known.all()
    assert (found > 0).all()


def test_a_run_can_take_its_distances_from_the_cloud(box_shape: Shape) -> None:
    counts = Counts(manifold=10, non_manifold=10, shell=10, pool=400)
    data = ShapeDataModule(box_shape, counts, seed=0, cloud_size=20000, pool_size=5000, distances="cloud")
    samples = data.sampler.draw(0)
    exact = network_distance(box_shape, data.cloud.normalisation).signed(samples.pool.double().numpy())
    np.testing.assert_allclose(samples.pool_distances.numpy(), exact, atol=0.02)
    assert (exact < 0).any()
    assert len(data.sampler.pool) < 5000
    with pytest.raises(InputError, match=r"data\.distances=guess: accepted are mesh, cloud"):
        ShapeDataModule(box_shape, counts, seed=0, cloud_size=100, pool_size=10, distances="guess")


def test_cells_stay_bounded_for_a_dense_cloud() -> None:
    cloud = cloud_of(trimesh.creation.box((2, 0.05, 0.05)), 200_000)
    space = FreeSpace(cloud.points)
    assert space.cells == FINEST
    found, known = space.signed(probes())
    exact = np.abs(probes()) - np.array([2, 0.05, 0.05]) / 2 / cloud.normalisation.scale
    assert (found[known & (exact > 0).any(1)] > 0).all()
    assert known[(exact > 2 * space.reach).any(1)].all()


def test_a_cloud_that_leaves_no_free_space_is_refused(box_shape: Shape) -> None:
    counts = Counts(manifold=10, non_manifold=10, shell=10, pool=10)
    with pytest.raises(InputError, match="8 points leave no free space"):
        ShapeDataModule(box_shape, counts, seed=0, cloud_size=8, pool_size=500, distances="cloud")
