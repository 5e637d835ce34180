"""Signs from points alone: never wrong where they are given, given wherever walls are thick enough."""

import numpy as np
import pytest
import trimesh
from analytic import box_distance
from clouds import cloud_of
from scipy.ndimage import label

from jointsdf.data.free_space import LEAST_INSIDE_CELLS, MOST_CELLS, FreeSpace
from jointsdf.data.streams import stream
from jointsdf.values import BOX


def probes(count: int = 40000) -> np.ndarray:
    return stream(1, 0).uniform(-BOX, BOX, (count, 3))


def test_sphere() -> None:
    cloud = cloud_of(trimesh.creation.icosphere(5, 0.7))
    space, points = FreeSpace(cloud.points), probes()
    signs = space.sign(points)
    exact = np.linalg.norm(points - cloud.normalisation.forward(np.zeros((1, 3))), axis=1)
    exact -= 0.7 / cloud.normalisation.scale
    assert 0.01 < space.reach < 0.1
    assert (signs != 0)[np.abs(exact) > 1.5 * space.reach].all()
    assert not signs[np.abs(exact) < 0.5 * space.reach].any()
    np.testing.assert_array_equal(signs[signs != 0], np.sign(exact)[signs != 0])


@pytest.mark.parametrize("thickness", [0.02, 0.5])
def test_a_plate_is_outside_on_both_sides_and_inside_only_where_it_is_thick(thickness: float) -> None:
    cloud = cloud_of(trimesh.creation.box((2, 2, thickness)))
    space, points = FreeSpace(cloud.points), probes()
    signs = space.sign(points)
    height = np.abs(points[:, 2]) - thickness / 2 / cloud.normalisation.scale
    assert ((signs < 0) <= (height < 0)).all()
    assert (signs[(signs != 0) & (height >= 0)] > 0).all()
    assert (signs[height > 2 * space.reach] == 1).all(), "certain above and below"
    assert (signs < 0).any() == (thickness > 0.1)


def test_a_tube_is_outside_within() -> None:
    cloud = cloud_of(trimesh.creation.annulus(0.4, 0.6, 2.0))
    axis = np.stack([np.zeros(50), np.zeros(50), np.linspace(-1, 1, 50)], axis=1)
    assert (FreeSpace(cloud.points).sign(axis) == 1).all()


@pytest.mark.parametrize("extents", [(2, 2, 0.01), (2, 2, 2)], ids=["plate", "cube"])
def test_empty_balls_give_signs_nearer_to_the_surface_than_free_space(extents: tuple[float, float, float]) -> None:
    cloud = cloud_of(trimesh.creation.box(extents))
    space, half = FreeSpace(cloud.points), np.array(extents) / 2 / cloud.normalisation.scale
    centre = cloud.normalisation.forward(np.zeros((1, 3)))
    around = cloud.points[stream(2, 0).integers(len(cloud.points), size=20000)]
    points = np.clip(around + stream(3, 0).uniform(-1, 1, around.shape) * space.reach, -BOX, BOX)
    exact = box_distance(points - centre, half)
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    steps = [box_distance(points - centre + 1e-4 * axis, half) * np.sign(exact) for axis in axes]
    signs = space.sign_by_empty_ball(
        points, axes[np.argmax(steps, axis=0)]
    )  # along the axis that leads away from the surface
    near = space.sign(points) == 0
    certain = near & (signs != 0)
    np.testing.assert_array_equal(signs[certain], np.sign(exact)[certain])
    assert certain.sum() > 0.25 * (near & (exact > 0)).sum()
    assert np.abs(exact[certain]).min() < 0.15 * space.reach


def test_the_widest_places_of_a_gap_do_not_count_as_inside() -> None:
    """A slot about as wide as twice the gaps between points, so that a few cells of it are free."""
    slabs = [trimesh.creation.box((2, 2, 0.5)).apply_translation((0, 0, side * 0.365)) for side in (-1, 1)]
    cloud = cloud_of(trimesh.util.concatenate(slabs))
    space = FreeSpace(cloud.points)
    middle = cloud.normalisation.forward(np.zeros((1, 3)))[0, 2]
    slot = np.abs((np.arange(space.cells) + 0.5) * 2 * BOX / space.cells - BOX - middle) < 0.05
    assert not (space.signs[:, :, slot] < 0).any()
    assert (space.signs < 0).any()
    assert np.bincount(label(space.signs < 0)[0].ravel())[1:].min() >= LEAST_INSIDE_CELLS


def test_cells_stay_bounded_for_a_dense_cloud() -> None:
    cloud = cloud_of(trimesh.creation.box((2, 0.05, 0.05)), 200_000)
    space = FreeSpace(cloud.points)
    assert space.cells == MOST_CELLS
    signs = space.sign(probes())
    beyond = np.abs(probes()) - np.array([2, 0.05, 0.05]) / 2 / cloud.normalisation.scale
    assert (signs[(signs != 0) & (beyond > 0).any(1)] > 0).all()
    assert (signs != 0)[(beyond > 2 * space.reach).any(1)].all()
