"""Signs of the distance to what is loaded of several bodies, against the inside by formula."""

from collections.abc import Callable

import igl
import numpy as np
import pytest
import trimesh
from damaged_meshes import Inside, box, in_box, joined, loaded, points_about, signed, wrong_signs

BIG, MIDDLE, SMALL, TINY = 4.0, 2.0, 1.0, 0.5
A, B, C = in_box(1.0), in_box(1.0, (2, 0, 0)), in_box(1.0, (4, 0.3, 0))
HOLLOW: Inside = lambda points: in_box(BIG)(points) & ~in_box(MIDDLE)(points)  # noqa: E731


def three(points: np.ndarray) -> np.ndarray:
    return A(points) | B(points) | C(points)


def deep(points: np.ndarray) -> np.ndarray:
    return HOLLOW(points) | (in_box(SMALL)(points) & ~in_box(TINY)(points))


BODIES: dict[str, tuple[list[trimesh.Trimesh], Inside, str, int]] = {
    "three, one inside out": (
        [box(1.0), box(1.0, (2, 0, 0), inverted=True), box(1.0, (4, 0.3, 0))],
        three,
        "1 of 3 components was inside out: flipped",
        12,
    ),
    "three, two inside out": (
        [box(1.0, inverted=True), box(1.0, (2, 0, 0), inverted=True), box(1.0, (4, 0.3, 0))],
        three,
        "2 of 3 components were inside out: flipped",
        24,
    ),
    "a cavity": ([box(BIG), box(MIDDLE, inverted=True)], HOLLOW, "", 0),
    "a cavity wound like its body": (
        [box(BIG), box(MIDDLE)],
        HOLLOW,
        "1 component lies inside another: taken as a cavity",
        12,
    ),
    "a cavity and its body inside out": (
        [box(BIG, inverted=True), box(MIDDLE)],
        HOLLOW,
        "1 of 2 components was inside out: flipped",
        24,
    ),
    "nested three deep, one winding": (
        [box(TINY), box(SMALL), box(BIG), box(MIDDLE)],
        deep,
        "2 components lie inside others: taken as cavities",
        24,
    ),
    "nested three deep, all inside out": (
        [box(size, inverted=True) for size in (BIG, MIDDLE, SMALL, TINY)],
        deep,
        "2 of 4 components were inside out: flipped",
        24,
    ),
}


@pytest.mark.parametrize("case", BODIES)
@pytest.mark.parametrize(("scale", "offset"), [(1.0, 0.0), (1e-6, 0.0), (1e9, 0.0), (1.0, 4e6)])
def test_every_body_is_wound_by_its_volume_and_nesting(
    caplog: pytest.LogCaptureFixture, case: str, scale: float, offset: float
) -> None:
    bodies, inside, message, flipped = BODIES[case]
    vertices, faces = joined(*bodies)
    shape = loaded(vertices * scale + offset, faces)
    assert (shape.watertight, shape.folded, shape.flipped, shape.dropped) == (True, False, flipped, 0)
    assert message in caplog.text
    assert ("inside" in caplog.text) == bool(message)
    assert wrong_signs(shape, lambda points: inside((points - offset) / scale)) == 0


def test_volume_is_what_the_bodies_hold() -> None:
    shape = loaded(*joined(box(BIG), box(MIDDLE), box(SMALL, (5, 0, 0), inverted=True)))
    solid = trimesh.Trimesh(shape.mesh.vertices, shape.mesh.faces, process=False)
    assert solid.volume == pytest.approx(BIG**3 - MIDDLE**3 + SMALL**3)


def test_a_hundred_balls_half_of_them_inside_out(caplog: pytest.LogCaptureFixture) -> None:
    middles = np.stack(np.unravel_index(np.arange(100), (5, 5, 4)), axis=1) * 1.0
    balls = [trimesh.creation.icosphere(1, 0.3).apply_translation(middle) for middle in middles]
    for ball in balls[::2]:
        ball.invert()
    shape = loaded(*joined(*balls))
    assert "50 of 100 components were inside out" in caplog.text
    points = points_about(shape, 5000)
    exact = igl.winding_number(shape.mesh.vertices, shape.mesh.faces, points)
    apart = np.linalg.norm(points[:, None] - middles, axis=2).min(axis=1)
    assert (exact[apart < 0.25] > 0.5).all()
    np.testing.assert_array_equal(signed(shape, points) < 0, exact > 0.5)


def test_balls_with_cavities_hundreds_of_them_are_wound_right() -> None:
    middles = np.stack(np.unravel_index(np.arange(343), (7, 7, 7)), axis=1) * 1.0
    ball, hole = trimesh.creation.icosphere(1, 0.4), trimesh.creation.icosphere(1, 0.2)
    shape = loaded(*joined(*(part.copy().apply_translation(at) for at in middles for part in (ball, hole))))
    solid = trimesh.Trimesh(shape.mesh.vertices, shape.mesh.faces, process=False)
    assert shape.flipped == 343 * len(hole.faces)
    assert solid.volume == pytest.approx(343 * (ball.volume - hole.volume))


def mixed(faces: np.ndarray) -> np.ndarray:
    faces = faces.copy()
    faces[::3] = faces[::3, ::-1]
    return faces


WINDINGS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "right": lambda faces: faces,
    "inside out": lambda faces: faces[:, ::-1],
    "mixed": mixed,
}


@pytest.mark.parametrize("winding", WINDINGS)
def test_an_open_box_is_wound_outward(caplog: pytest.LogCaptureFixture, winding: str) -> None:
    whole = trimesh.creation.icosphere(3).apply_scale((1.0, 0.7, 0.5))
    kept = whole.faces[whole.triangles_center[:, 2] < 0.45]
    shape = loaded(np.array(whole.vertices), WINDINGS[winding](kept))
    assert not shape.watertight
    inside = np.cross(*(np.diff(shape.mesh.vertices[shape.mesh.faces], axis=1).swapaxes(0, 1)))
    centres = shape.mesh.vertices[shape.mesh.faces].mean(axis=1)
    assert (np.einsum("ij,ij->i", inside, centres) > 0).all()
    assert (shape.flipped > 0) == (winding != "right")
    assert ("inside out" in caplog.text) == (winding != "right")


def test_panels_with_gaps_between_them_face_outward() -> None:
    solid = box((2.0, 3.0, 4.0))
    corners = np.array(solid.triangles)
    shrunk = corners.mean(axis=1, keepdims=True) + 0.99 * (corners - corners.mean(axis=1, keepdims=True))
    faces = np.arange(36).reshape(-1, 3)
    shape = loaded(shrunk.reshape(-1, 3), mixed(faces))
    assert (shape.watertight, shape.flipped) == (False, 4)
    middle = np.random.default_rng(0).uniform(-0.4, 0.4, (1000, 3)) * (2, 3, 4)
    assert (signed(shape, middle) < 0).all()


def test_a_cavity_of_a_body_with_a_hole_stays_a_cavity() -> None:
    outer, inner = trimesh.creation.icosphere(3), trimesh.creation.icosphere(2, 0.5)
    inner.invert()
    outer.update_faces(np.arange(len(outer.faces)) > 0)
    shape = loaded(*joined(outer, inner))
    assert (shape.watertight, shape.flipped) == (False, 0)
    inner.invert()
    assert loaded(*joined(outer, inner)).flipped == len(inner.faces)
