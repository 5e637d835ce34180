"""Outer sides of open patches of known ones."""

import numpy as np
import pytest
import trimesh

from jointsdf.shapes.visibility import vote_on_sides


def panels(turned: list[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The six sides of a box as patches, a gap between them, some inside out."""
    vertices, faces = [], []
    for side in range(6):
        axis, sign = side // 2, 1 - 2 * (side % 2)
        u, v = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
        corners = np.array(
            [sign * np.eye(3)[axis] + 0.98 * (a * u + b * v) for a, b in [(-1, -1), (1, -1), (1, 1), (-1, 1)]]
        )
        outward = np.array([[0, 1, 2], [0, 2, 3]])[:, :: sign if side not in turned else -sign]
        vertices.append(corners)
        faces.append(outward + 4 * side)
    return np.concatenate(vertices), np.concatenate(faces), np.repeat(np.arange(6), 2)


@pytest.mark.parametrize("turned", [[], [0], [1, 2, 5], [0, 1, 2, 3, 4, 5]])
def test_panels_of_a_box_are_told_by_rays(turned: list[int]) -> None:
    vertices, faces, patch = panels(turned)
    votes = vote_on_sides(vertices, faces, patch, np.zeros(12, dtype=bool))
    assert votes.tolist() == [-1 if side in turned else 1 for side in range(6)]


def test_walls_within_and_flat_sheets_have_no_outer_side() -> None:
    vertices, faces, patch = panels([])
    wall = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [-1, -1, 3], [1, -1, 3], [1, 1, 3], [-1, 1, 3.0]])
    squares = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]) + len(vertices)
    votes = vote_on_sides(
        np.concatenate([vertices, wall]),
        np.concatenate([faces, squares]),
        np.concatenate([patch, [6, 6, 7, 7]]),
        np.zeros(16, dtype=bool),
    )
    assert votes.tolist() == [1] * 6 + [0, 0]


def test_two_sheets_at_one_place_stop_no_ray_and_have_no_outer_side() -> None:
    ball = trimesh.creation.icosphere(3)
    wall = np.array([[-2.0, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]])
    cuts = np.array([[0, 1, 2], [0, 2, 3], [4, 7, 5], [5, 7, 6]]) + len(ball.vertices)  # by the other diagonal
    vertices, faces = np.concatenate([ball.vertices, wall, wall]), np.concatenate([ball.faces, cuts])
    patch = np.repeat([0, 1, 2], [len(ball.faces), 2, 2])
    assert vote_on_sides(vertices, faces, patch, np.zeros(len(faces), dtype=bool)).tolist() == [1, 0, 0]


@pytest.mark.parametrize("first", [True, False])
def test_a_small_sheet_on_a_large_one_leaves_that_its_outer_side(first: bool) -> None:
    vertices, faces, patch = panels([])
    small = 0.1 * vertices[:4] * (0, 1, 1) + (1, 0, 0)
    order = slice(None) if first else np.roll(np.arange(14), 12)
    faces = np.concatenate([faces[:2] + len(vertices), faces])[order]
    patch = np.concatenate([[6, 6], patch])[order]
    votes = vote_on_sides(np.concatenate([vertices, small]), faces, patch, np.zeros(14, dtype=bool))
    assert votes[:6].tolist() == [1] * 6
