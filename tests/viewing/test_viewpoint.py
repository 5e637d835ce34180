"""Places and directions on solids whose creases are known."""

import numpy as np
import pytest
import trimesh
from labelled_meshes import sphere
from solids import labelled

from jointsdf.geometry.creases import find_creases
from jointsdf.viewing.raycast import viewing_axes
from jointsdf.viewing.viewpoint import USUAL, best_axes, crowded_place


def test_the_place_is_where_small_edges_are_close_together() -> None:
    large, small = trimesh.creation.box((10, 10, 10)), trimesh.creation.box((0.5, 0.5, 0.5))
    small.apply_translation((20, 3, -4))
    mesh = labelled(trimesh.util.concatenate([large, small]))
    place = crowded_place(find_creases(mesh, 0.02), 0.5)
    assert (np.abs(place - [20, 3, -4]) < 0.26).all()


@pytest.mark.parametrize("corner", [(1, 1, 1), (-1, 1, 1), (1, -1, -1)])
@pytest.mark.parametrize("up", ["y", "z"])
def test_a_corner_of_a_cube_is_seen_from_outside_with_its_three_sides(corner: tuple[int, int, int], up: str) -> None:
    mesh = labelled(trimesh.creation.box((2, 2, 2)))
    axes = best_axes(mesh, find_creases(mesh, 0.004), np.array(corner, dtype=float), 0.5, up)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(np.stack([axes[0], axes[1], -axes[2]])) == pytest.approx(1)
    assert (-axes[2] * corner).min() > 0.4
    assert axes[1]["xyz".index(up)] > 0


def test_what_is_hidden_is_not_looked_at_from_there() -> None:
    """The cube's corner would be seen best from above, but there is a roof."""
    cube, roof = trimesh.creation.box((2, 2, 2)), trimesh.creation.box((20, 20, 0.1))
    roof.apply_translation((0, 0, 1.3))
    mesh = labelled(trimesh.util.concatenate([cube, roof]))
    heights = [
        -best_axes(each, find_creases(each, 0.004), np.array([1.0, 1, z]), 0.2, "z")[2, 2]
        for each in (labelled(cube), mesh)
        for z in (1, -1)
    ]
    assert np.sign(heights).tolist() == [1, -1, -1, -1]


def test_without_creases_the_direction_is_the_usual_one() -> None:
    ball = sphere(1.0)
    axes = best_axes(ball, find_creases(ball, 0.002), np.array([1.0, 0, 0]), 0.1, "z")
    np.testing.assert_array_equal(axes, viewing_axes(*USUAL))
