"""The fifty built-in parts."""

import hashlib
from functools import cache

import numpy as np
import pytest
import trimesh
from numpy import ndarray
from solids import as_trimesh

from jointsdf.shapes import load
from jointsdf.shapes.builtin import FAMILIES, construction, part_names
from jointsdf.values import Shape


@cache
def built(name: str) -> Shape:
    return load(name, abc_root="unused")


@cache
def solid(name: str) -> trimesh.Trimesh:
    return as_trimesh(built(name).mesh)


def test_names_are_fifty_from_ten_families_of_five() -> None:
    assert part_names() == [f"part_{number:02d}" for number in range(1, 51)]
    assert [len(family) for family in FAMILIES] == [5] * 10


@pytest.mark.parametrize("name", part_names())
def test_part_is_one_clean_solid_with_labels_by_falling_area(name: str) -> None:
    shape, mesh = built(name), solid(name)
    assert mesh.is_volume
    assert mesh.volume > 0
    assert mesh.body_count == 1
    assert mesh.area_faces.min() > 1e-6
    assert mesh.bounds.min() >= 0
    assert np.linalg.norm(mesh.bounds.mean(axis=0)) > 10, "millimetres, off the origin"
    areas = np.bincount(shape.mesh.labels, mesh.area_faces)
    assert 2 <= len(areas) <= 18
    assert areas.min() > 0.002 * areas.sum(), "a part too small to learn"
    assert (np.diff(areas) <= 1e-6 * areas[0]).all(), "equal areas in any order"
    assert (shape.label_provider, shape.watertight, shape.name) == ("builtin", True, name)


def test_parts_are_the_same_every_time() -> None:
    expected = [(built(name).mesh_sha256, built(name).labels_sha256) for name in part_names()]
    again = [load(name, abc_root="unused") for name in part_names()]
    assert [(shape.mesh_sha256, shape.labels_sha256) for shape in again] == expected


def test_parts_differ_in_mesh_size_place_and_number_of_parts() -> None:
    assert len({built(name).mesh_sha256 for name in part_names()}) == 50
    assert len({tuple(solid(name).bounds[0].round(3)) for name in part_names()}) == 50
    sizes = [solid(name).extents.max() for name in part_names()]
    assert max(sizes) > 3 * min(sizes)
    assert {len(built(name).mesh.part_ids) for name in part_names()} == set(range(2, 19))


@pytest.mark.parametrize(
    ("name", "digest"),
    [
        ("part_01", "d98d1d94a8290457b40d3886db4dcd4175335f6f657a4112a896c4fcddbf4f2f"),
        ("part_18", "7b2585472721112a5c5b3d6223953ff7e6619fe419489998b58005d0e921fee9"),
        ("part_31", "1415dabc87cd28aac552d061f447856c17327e4d32a3aea406fd664d0dcc9ada"),
        ("part_50", "5b2a703039b6092a1a25944dc02e21c60693845967d8068f42cb284fcdd9f586"),
    ],
)
def test_corners_are_the_same_on_every_machine(name: str, digest: str) -> None:
    assert corners_sha256(built(name).mesh.vertices) == digest


def corners_sha256(vertices: ndarray) -> str:
    rounded = np.rint(vertices * 1e5).astype("<i8")
    return hashlib.sha256(np.unique(rounded, axis=0).tobytes()).hexdigest()


@pytest.mark.parametrize("name", part_names()[6:18])
def test_last_bits_of_coordinates_do_not_change_the_mesh(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    generator, snap_to_grid = np.random.default_rng(0), construction.snap_to_grid

    def disturbed(vertices: ndarray, grid: float) -> ndarray:
        return snap_to_grid(vertices + generator.uniform(-1e-13, 1e-13, vertices.shape), grid)

    monkeypatch.setattr(construction, "snap_to_grid", disturbed)
    assert load(name, abc_root="unused").mesh_sha256 == built(name).mesh_sha256


HOLES = {
    "part_01": 5, "part_02": 0, "part_03": 6, "part_04": 3, "part_05": 1, "part_06": 7, "part_07": 1, "part_08": 14,
    "part_10": 2, "part_11": 5, "part_15": 0, "part_18": 13, "part_20": 2, "part_21": 6, "part_25": 4, "part_28": 9,
    "part_33": 10, "part_34": 6, "part_38": 23, "part_40": 5, "part_44": 5, "part_48": 18, "part_50": 4,
}  # fmt: skip


@pytest.mark.parametrize(("name", "holes"), HOLES.items())
def test_through_holes_are_the_drawn_ones(name: str, holes: int) -> None:
    assert solid(name).euler_number == 2 - 2 * holes


def test_at_least_eight_parts_are_thin_walled() -> None:
    assert sum(thin_share(name) > 0.5 for name in part_names()) >= 8


def thin_share(name: str) -> float:
    """Share of the surface behind which 2% to 4% of the part's size is solid."""
    mesh = solid(name)
    points, faces = trimesh.sample.sample_surface(mesh, 400, seed=0)
    inwards = -mesh.face_normals[faces]
    ends, rays, _ = mesh.ray.intersects_location(points + 1e-4 * inwards, inwards, multiple_hits=False)
    thickness = np.linalg.norm(ends - points[rays], axis=1) / mesh.extents.max()
    return float(((thickness > 0.0199) & (thickness < 0.0401)).sum() / len(points))


@pytest.mark.parametrize("name", sorted(set(part_names()) - {"part_04", "part_14", "part_24", "part_34", "part_44"}))
def test_no_part_ends_inside_a_flat_face(name: str) -> None:
    """Where two primitives share a plane, construction could not say whose face it is; only stacked plates may."""
    mesh, labels = solid(name), built(name).mesh.labels[solid(name).face_adjacency]
    assert not ((labels[:, 0] != labels[:, 1]) & (mesh.face_adjacency_angles < 1e-4)).any()


def test_thin_tray_has_walls_of_two_percent() -> None:
    mesh = built("part_05").mesh
    assert 0.015 < 2.0 / np.ptp(mesh.vertices, axis=0).max() < 0.02
    inside = np.array([[6.0, 37, 40], [4.9, 37, 40], [7.1, 37, 40]])
    assert solid("part_05").contains(inside).tolist() == [True, False, False]
