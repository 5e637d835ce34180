"""The simulated scanner on boxes: what is seen, what is hidden, and how far a range is off."""

import numpy as np
import pytest
import trimesh
from solids import labelled

from jointsdf.data.scanner import Scanner, spread_directions
from jointsdf.errors import InputError
from jointsdf.values import LabelledMesh


def scan(mesh: LabelledMesh, views: int, noise: float = 0.0, rays: int = 20000) -> tuple[np.ndarray, np.ndarray]:
    return Scanner(views, noise).scan(mesh, rays, np.random.default_rng(0), np.random.default_rng(1))


def test_places_are_spread_evenly_and_turned_together() -> None:
    directions = spread_directions(200, np.random.default_rng(0))
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-12)
    apart = np.arccos(np.clip(directions @ directions.T - 2 * np.eye(200), -1, 1)).min(axis=1)
    assert apart.min() > 0.75 * np.sqrt(4 * np.pi / 200)
    np.testing.assert_allclose(directions.mean(axis=0), 0, atol=0.01)
    assert not np.allclose(directions, spread_directions(200, np.random.default_rng(1)))


def test_without_noise_the_points_lie_on_the_faces_met(box: LabelledMesh) -> None:
    points, faces = scan(box, 12)
    corners = box.vertices[box.faces[faces]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    np.testing.assert_allclose(((points - corners[:, 0]) * normals).sum(axis=1), 0, atol=1e-12)
    assert set(faces) == set(range(len(box.faces))), "twelve places see every side of a box"


def test_what_is_hidden_gives_no_point() -> None:
    inner = trimesh.creation.box((1, 1, 1))
    points, faces = scan(labelled(trimesh.creation.box((4, 4, 4)) + inner), 12)
    assert len(points) > 5000
    assert faces.max() < 12, "the inner box is never seen"
    one_view, _ = scan(labelled(trimesh.creation.box((2, 2, 2))), 1)
    sides = np.isclose(np.abs(one_view), 1, atol=1e-9)
    seen = {
        (axis, value)
        for axis in range(3)
        for value in (-1, 1)
        if (sides[:, axis] & (one_view[:, axis] * value > 0)).any()
    }
    assert 1 <= len(seen) <= 3, "one place sees at most three sides of a box"


def test_the_noise_lies_along_the_rays() -> None:
    solid = labelled(trimesh.creation.box((4, 2, 2)))
    clean, faces = scan(solid, 5)
    noisy, same = scan(solid, 5, 0.01)
    np.testing.assert_array_equal(faces, same)
    moved = noisy - clean
    assert np.linalg.norm(moved, axis=1).std() < 0.04
    assert np.sqrt((moved**2).sum(axis=1).mean()) == pytest.approx(0.01 * 4, rel=0.03), "a share of the longest side"
    corners = solid.vertices[solid.faces[faces]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    slopes = np.abs((moved * normals).sum(axis=1)) / np.linalg.norm(moved, axis=1)
    assert slopes.min() > np.cos(np.radians(80.01)), "a ray that grazes the surface gives no point"


@pytest.mark.parametrize(
    ("given", "word"), [({"views": -1}, "views=-1"), ({"views": 2.5}, "views"), ({"noise": 2.0}, "noise=2")]
)
@pytest.mark.usefixtures("as_in_training")
def test_impossible_settings_are_input_errors(given: dict, word: str) -> None:
    with pytest.raises(InputError, match=word):
        Scanner(**given)
