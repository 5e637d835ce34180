"""Faces that are there twice, with opposite windings."""

import numpy as np
import pytest
import trimesh
from damaged_meshes import box, in_box, joined, loaded, wrong_signs

from jointsdf.geometry.topology import side_uses


def doubled(mesh: trimesh.Trimesh, which: np.ndarray, *, shared: bool) -> tuple[np.ndarray, np.ndarray]:
    vertices, faces = joined(mesh)
    back = faces[which][:, ::-1]
    if shared:
        return vertices, np.concatenate([faces, back])
    return np.concatenate([vertices, vertices]), np.concatenate([faces, back + len(vertices)])


@pytest.mark.parametrize("shared", [True, False])
@pytest.mark.parametrize("inverted", [True, False])
def test_every_face_doubled_gives_the_body(caplog: pytest.LogCaptureFixture, shared: bool, inverted: bool) -> None:
    shape = loaded(*doubled(box(2.0, inverted=inverted), np.arange(12), shared=shared))
    assert "12 faces are doubled with the opposite winding: dropped" in caplog.text
    assert (len(shape.mesh.faces), shape.dropped, shape.watertight, shape.folded) == (12, 12, True, False)
    assert wrong_signs(shape, in_box(2.0)) == 0


@pytest.mark.parametrize("shared", [True, False])
def test_a_few_faces_doubled_give_the_body(shared: bool) -> None:
    solid = box(2.0)
    shape = loaded(*doubled(solid, np.flatnonzero(solid.face_normals[:, 0] > 0.5), shared=shared))
    assert (len(shape.mesh.faces), shape.watertight) == (12, True)
    assert wrong_signs(shape, in_box(2.0)) == 0


def test_doubled_bodies_with_a_cavity_give_both() -> None:
    outer, inner = doubled(box(3.0), np.arange(12), shared=False), doubled(box(1.0), np.arange(12), shared=False)
    shape = loaded(np.concatenate([outer[0], inner[0]]), np.concatenate([outer[1], inner[1] + 16]))
    assert (len(shape.mesh.faces), shape.watertight) == (24, True)
    assert wrong_signs(shape, lambda points: in_box(3.0)(points) & ~in_box(1.0)(points)) == 0


def test_an_open_box_with_both_sides_is_one_sheet_and_wound_outward() -> None:
    lid_off = box(1.0)
    lid_off.update_faces(lid_off.face_normals[:, 2] < 0.5)
    shape = loaded(*doubled(lid_off, np.arange(10), shared=False))
    assert (len(shape.mesh.faces), shape.dropped, shape.watertight) == (10, 10, False)
    normals = trimesh.Trimesh(shape.mesh.vertices, shape.mesh.faces, process=False).face_normals
    centres = shape.mesh.vertices[shape.mesh.faces].mean(axis=1)
    assert (np.einsum("ij,ij->i", normals, centres) > 0).all()


@pytest.mark.parametrize("windings", [(1, 1), (1, -1), (1, 1, 1), (1, -1, 1), (1, -1, 1, -1)])
@pytest.mark.parametrize("lid", [True, False])
def test_copies_of_any_winding_and_number_are_one_surface(windings: tuple[int, ...], lid: bool) -> None:
    solid = box(1.0)
    if not lid:
        solid.update_faces(solid.face_normals[:, 2] < 0.5)
    vertices, faces = joined(solid)
    shape = loaded(vertices, np.concatenate([faces[:, ::winding] for winding in windings]))
    assert (len(shape.mesh.faces), shape.dropped) == (len(faces), (len(windings) - 1) * len(faces))
    assert wrong_signs(shape, in_box(1.0)) == 0


def test_both_sides_wound_at_random_are_one_body() -> None:
    vertices, faces = joined(trimesh.creation.icosphere(2))
    both = np.concatenate([faces, faces[:, ::-1]])
    turned = np.random.default_rng(0).random(len(both)) < 0.5
    shape = loaded(vertices, np.where(turned[:, None], both[:, ::-1], both))
    assert (shape.watertight, len(shape.mesh.faces)) == (True, len(faces))


def test_a_repeated_face_with_two_open_sides_is_dropped() -> None:
    solid = box(1.0)
    solid.update_faces(solid.face_normals[:, 2] < 0.5)
    vertices, faces = joined(solid)
    row, side = np.argwhere(side_uses(faces) == 1)[0]
    flap = [faces[row, (side + 1) % 3], faces[row, side], len(vertices)]  # joined to the rim, its other sides open
    shape = loaded(np.concatenate([vertices, [[0.0, 0.0, 2.0]]]), np.concatenate([faces, [flap, flap]]))
    assert (shape.dropped, len(shape.mesh.faces)) == (1, 11)
