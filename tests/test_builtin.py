import numpy as np
import pytest
import trimesh

from jointsdf.shapes import load
from jointsdf.shapes.builtin import BUILTINS, Construction, box, part_names, rod
from jointsdf.values import Shape


def built(name: str) -> Shape:
    return load(name, abc_root="unused")


def solid(shape: Shape) -> trimesh.Trimesh:
    return trimesh.Trimesh(shape.mesh.vertices, shape.mesh.faces, process=False)


@pytest.mark.parametrize("name", part_names())
def test_part_is_one_clean_solid_with_labels_by_falling_area(name: str) -> None:
    shape = built(name)
    mesh = solid(shape)
    assert mesh.is_volume
    assert mesh.body_count == 1
    assert mesh.area_faces.min() > 1e-6
    assert mesh.bounds.min() >= 0
    assert np.linalg.norm(mesh.bounds.mean(axis=0)) > 10, "millimetres, off the origin"
    areas = np.bincount(shape.mesh.labels, mesh.area_faces)
    assert 2 <= len(areas) <= 18
    assert areas.min() > 0.005 * areas.sum(), "a part too small to learn"
    assert (np.diff(areas) <= 0).all()
    assert (shape.label_provider, shape.watertight, shape.name) == ("builtin", True, name)


@pytest.mark.parametrize("name", part_names())
def test_part_is_the_same_every_time(name: str) -> None:
    first, second = built(name), built(name)
    assert first.mesh_sha256 == second.mesh_sha256
    np.testing.assert_array_equal(first.mesh.labels, second.mesh.labels)


def test_parts_differ() -> None:
    assert len({built(name).mesh_sha256 for name in part_names()}) == len(BUILTINS) >= 6


@pytest.mark.parametrize(
    ("name", "holes"),
    [("part_01", 5), ("part_02", 0), ("part_03", 6), ("part_04", 3), ("part_05", 1), ("part_06", 7)],
)
def test_through_holes_are_the_drawn_ones(name: str, holes: int) -> None:
    assert solid(built(name)).euler_number == 2 - 2 * holes


def test_every_face_keeps_the_primitive_it_came_from() -> None:
    part = Construction()
    part.add("block", box((1, 2, 3), (11, 12, 8)))
    part.cut("hole", rod((6, 7, 0), 10, 2.0))
    part.add("boss", rod((3, 4, 7), 4, 1.0))
    mesh = part.mesh()
    centres = mesh.vertices[mesh.faces].mean(axis=1)
    on_hole = np.hypot(centres[:, 0] - 6, centres[:, 1] - 7) < 2.0 - 1e-9
    on_boss = (np.hypot(centres[:, 0] - 3, centres[:, 1] - 4) < 1.0) & (centres[:, 2] > 8 + 1e-9)
    np.testing.assert_array_equal(mesh.labels, np.where(on_hole, 1, np.where(on_boss, 2, 0)))
    areas = np.bincount(mesh.labels, trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).area_faces)
    disc, boss = (24 * 4 * np.sin(np.pi / 48) / 2 * r * r for r in (2.0, 1.0))
    ring = [2 * 96 * r * np.sin(np.pi / 96) for r in (2.0, 1.0)]
    np.testing.assert_allclose(areas, [400 - 2 * disc - boss, 5 * ring[0], 3 * ring[1] + boss], rtol=1e-9)


def test_thin_tray_has_walls_of_two_percent() -> None:
    mesh = built("part_05").mesh
    assert 0.015 < 2.0 / np.ptp(mesh.vertices, axis=0).max() < 0.02
    inside = np.array([[6.0, 37, 40], [4.9, 37, 40], [7.1, 37, 40]])
    assert solid(built("part_05")).contains(inside).tolist() == [True, False, False]
