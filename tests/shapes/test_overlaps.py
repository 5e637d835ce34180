"""Bodies that overlap, touch or have fins: winding number, against the inside by formula."""

import numpy as np
import pytest
import trimesh
from damaged_meshes import Inside, box, in_box, joined, loaded, wrong_signs

from jointsdf.errors import InputError
from jointsdf.geometry.piercings import find_piercings

X, Y = (4.0, 0.4, 0.4), (0.4, 4.0, 0.3)


def either(*insides: Inside) -> Inside:
    return lambda points: np.any([inside(points) for inside in insides], axis=0)


OVERLAPPING: dict[str, tuple[list[trimesh.Trimesh], Inside]] = {
    "corners": ([box(1.0), box(1.0, (0.5, 0.4, 0.3))], either(in_box(1.0), in_box(1.0, (0.5, 0.4, 0.3)))),
    "one inside out": (
        [box(1.0), box(1.0, (0.5, 0.4, 0.3), inverted=True)],
        either(in_box(1.0), in_box(1.0, (0.5, 0.4, 0.3))),
    ),
    "bars that cross, no vertex in the other": ([box(X), box(Y)], either(in_box(X), in_box(Y))),
    "a pin through a plate": (
        [box((10.0, 10.0, 1.0)), box((0.03, 0.03, 2.0), (0.3, 0.2, 0))],
        either(in_box((10.0, 10.0, 1.0)), in_box((0.03, 0.03, 2.0), (0.3, 0.2, 0))),
    ),
    "mostly inside": ([box(2.0), box(0.5, (0.8, 0, 0))], either(in_box(2.0), in_box(0.5, (0.8, 0, 0)))),
}


@pytest.mark.parametrize("case", OVERLAPPING)
def test_bodies_that_overlap_take_the_winding_number(caplog: pytest.LogCaptureFixture, case: str) -> None:
    bodies, inside = OVERLAPPING[case]
    shape = loaded(*joined(*bodies))
    assert (shape.watertight, shape.folded) == (True, True)
    assert "closed faces overlap" in caplog.text
    assert wrong_signs(shape, inside) == 0


def test_bodies_that_touch_keep_their_faces_and_their_inside() -> None:
    middles = np.stack(np.unravel_index(np.arange(27), (3, 3, 3)), axis=1) - 1.0
    vertices, faces = joined(*(box(1.0, tuple(middle)) for middle in middles))
    shape = loaded(vertices, faces)
    assert (len(shape.mesh.faces), shape.watertight, shape.folded, shape.flipped) == (27 * 12, True, True, 0)
    assert wrong_signs(shape, in_box(3.0)) == 0


def test_a_body_that_fills_a_cavity_is_solid() -> None:
    shape = loaded(*joined(box(3.0), box(1.0, inverted=True), box(1.0)))
    assert (len(shape.mesh.faces), shape.folded) == (36, True)
    assert wrong_signs(shape, in_box(3.0)) == 0


def test_a_fin_of_no_thickness_does_not_turn_the_space_about_it() -> None:
    solid = box(2.0)
    corners = np.concatenate([solid.vertices, [[1.0, 3.0, 0.0]]])
    edge = np.flatnonzero((solid.vertices[:, 0] > 0) & (solid.vertices[:, 1] > 0))
    first = next(index for index, face in enumerate(solid.faces) if set(edge) <= set(face))
    face = solid.faces[first]
    turn = next(t for t in range(3) if set(edge) == {face[t], face[(t + 1) % 3]})
    start, end = face[turn], face[(turn + 1) % 3]
    # Each of the edge's own two faces is joined to a side of the fin, as by a program that gives it its own copy.
    apart = np.concatenate([corners, corners[[start, end, 8]]])
    faces = np.concatenate([solid.faces, [[start, end, 8], [9, 11, 10]]])
    shape = loaded(apart, faces)
    assert len(shape.mesh.faces) == 14
    assert wrong_signs(shape, in_box(2.0)) == 0


def test_a_mesh_that_overlaps_itself_is_folded() -> None:
    around = np.linspace(0, 2 * np.pi, 120, endpoint=False)
    centre = np.stack([np.cos(around), np.sin(2 * around), 0.05 * np.cos(around)], axis=1)  # an eight, crossing itself
    ring = np.stack([np.cos(around[::10]), np.sin(around[::10])], axis=1)
    along = np.roll(centre, -1, axis=0) - np.roll(centre, 1, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(along, [0, 0, 1.0])
    up = np.cross(across, along)
    tube = centre[:, None] + 0.2 * (ring[:, :1] * across[:, None] + ring[:, 1:] * up[:, None])
    grid = np.arange(120 * 12).reshape(120, 12)
    a, b = grid, np.roll(grid, -1, axis=0)
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    shape = loaded(tube.reshape(-1, 3), faces)
    assert (shape.watertight, shape.folded) == (True, True)


def test_edges_that_pass_through_faces_are_found_with_their_depth() -> None:
    vertices, faces = joined(box(1.0), box(1.0, (0.9, 0.5, 0.5)))
    found = find_piercings(vertices, faces)
    assert {(a // 12, b // 12) for a, b in zip(found.face, found.pierced, strict=True)} == {(0, 1), (1, 0)}
    assert found.depth == pytest.approx(np.array([0.1, 0.5])[np.digitize(found.depth, [0.15])] / 1.9, abs=1e-9)
    assert len(find_piercings(*joined(box(1.0), box(1.0, (1.0, 0.3, 0.2)))).face) == 0, "they touch"


def disc() -> tuple[np.ndarray, np.ndarray]:
    angles = np.linspace(0, 2 * np.pi, 32, endpoint=False)
    rim = np.stack([np.cos(angles), np.sin(angles), 0.05 * np.cos(2 * angles)], axis=1)
    spokes = np.arange(32)
    return np.concatenate([rim, np.zeros((1, 3))]), np.stack([np.full(32, 32), spokes, (spokes + 1) % 32], axis=1)


def moebius() -> tuple[np.ndarray, np.ndarray]:
    angles = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    radial = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    half = 0.3 * (np.cos(angles / 2)[:, None] * radial + np.sin(angles / 2)[:, None] * [0, 0, 1])
    near, far = np.arange(60), np.arange(60) + 60
    following, beyond = np.append(near[1:], 60), np.append(far[1:], 0)
    faces = np.concatenate([np.stack([near, following, far], 1), np.stack([far, following, beyond], 1)])
    return np.concatenate([radial - half, radial + half]), faces


def terrain() -> tuple[np.ndarray, np.ndarray]:
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(40.0), np.arange(40.0)))
    grid = np.arange(1600).reshape(40, 40)
    a, b, c, d = (part.ravel() for part in (grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return np.stack([x, y, np.sin(x / 3) + np.cos(y / 4)], axis=1), faces


def both_sides(mesh: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    vertices, faces = mesh
    return np.concatenate([vertices, vertices]), np.concatenate([faces, faces[:, ::-1] + len(vertices)])


SHEETS = {"disc": disc(), "moebius": moebius(), "terrain": terrain(), "both sides of a disc": both_sides(disc())}


@pytest.mark.parametrize("sheet", SHEETS)
def test_sheets_that_enclose_nothing_are_refused(sheet: str) -> None:
    with pytest.raises(InputError, match=r"^it encloses almost nothing .*give open sheets a thickness"):
        loaded(*SHEETS[sheet])


def test_thin_walls_open_boxes_and_tubes_enclose_something() -> None:
    wall = loaded(*joined(box((100.0, 100.0, 0.05))))
    assert wrong_signs(wall, in_box((100.0, 100.0, 0.05))) == 0
    lid_off = box(1.0)
    lid_off.update_faces(lid_off.face_normals[:, 2] < 0.5)
    assert (signed_at_middle := loaded(*joined(lid_off))).watertight is False
    assert len(signed_at_middle.mesh.faces) == 10
    tray = box((1.0, 1.0, 0.02))
    tray.update_faces(tray.face_normals[:, 2] < 0.5)
    assert len(loaded(*joined(tray)).mesh.faces) == 10
    tube = trimesh.creation.cylinder(1.0, 4.0)
    tube.update_faces(np.abs(tube.face_normals[:, 2]) < 0.5)
    assert not loaded(*joined(tube)).watertight
