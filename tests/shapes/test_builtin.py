import hashlib
from functools import cache
from math import pi, sin

import numpy as np
import pytest
import trimesh
from numpy import ndarray

from jointsdf.shapes import load
from jointsdf.shapes.builtin import FAMILIES, construction, part_names
from jointsdf.shapes.builtin.angles import angle_bracket
from jointsdf.shapes.builtin.blocks import Drill, manifold_block
from jointsdf.shapes.builtin.construction import Construction, box, rod
from jointsdf.shapes.builtin.gears import gear
from jointsdf.shapes.builtin.pipes import Flange, neck_flange
from jointsdf.shapes.builtin.shafts import stepped_shaft
from jointsdf.shapes.builtin.trays import heat_sink, thin_tray
from jointsdf.values import LabelledMesh, Shape

DISC = 48 * sin(2 * pi / 96)  # area of a 96-sided disc by its squared radius: pi to 0.07%


@cache
def built(name: str) -> Shape:
    return load(name, abc_root="unused")


@cache
def solid(name: str) -> trimesh.Trimesh:
    return as_trimesh(built(name).mesh)


def as_trimesh(mesh: LabelledMesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


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
    generator, snapped = np.random.default_rng(0), construction.snapped

    def disturbed(vertices: ndarray, grid: float) -> ndarray:
        return snapped(vertices + generator.uniform(-1e-13, 1e-13, vertices.shape), grid)

    monkeypatch.setattr(construction, "snapped", disturbed)
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


def test_every_face_keeps_the_primitive_it_came_from() -> None:
    part = Construction()
    part.add("block", box((1, 2, 3), (11, 12, 8)))
    part.cut("hole", rod((6, 7, 0), 10, 2.0))
    part.add("boss", rod((3, 4, 7), 4, 1.0))
    mesh = part.mesh()
    centres = mesh.vertices[mesh.faces].mean(axis=1)
    on_hole = np.hypot(centres[:, 0] - 6, centres[:, 1] - 7) < 2.0 - 1e-5
    on_boss = (np.hypot(centres[:, 0] - 3, centres[:, 1] - 4) < 1.0) & (centres[:, 2] > 8 + 1e-9)
    np.testing.assert_array_equal(mesh.labels, np.where(on_hole, 1, np.where(on_boss, 2, 0)))
    areas = np.bincount(mesh.labels, as_trimesh(mesh).area_faces)
    disc, boss = (DISC * r * r for r in (2.0, 1.0))
    ring = [2 * 96 * r * np.sin(np.pi / 96) for r in (2.0, 1.0)]
    np.testing.assert_allclose(areas, [400 - 2 * disc - boss, 5 * ring[0], 3 * ring[1] + boss], rtol=1e-6)


def test_numbered_solids_are_parts_of_their_own() -> None:
    posts = [rod((x, 5, 0), 9, 1.0) for x in (3, 9)]
    for numbered, parts in ((True, 3), (False, 2)):
        part = Construction()
        part.add("block", box((0, 0, 0), (12, 10, 4)))
        part.add_each("post", posts, numbered=numbered)
        assert len(part.mesh().part_ids) == parts


def test_thin_tray_has_walls_of_two_percent() -> None:
    mesh = built("part_05").mesh
    assert 0.015 < 2.0 / np.ptp(mesh.vertices, axis=0).max() < 0.02
    inside = np.array([[6.0, 37, 40], [4.9, 37, 40], [7.1, 37, 40]])
    assert solid("part_05").contains(inside).tolist() == [True, False, False]


def volume(mesh: LabelledMesh) -> float:
    return float(as_trimesh(mesh).volume)


def test_flange_is_its_cylinders_without_its_holes() -> None:
    flange = Flange(radius=50, thickness=12, bolts=6, bolt=4)
    mesh = neck_flange(at=(7, 8, 9), flange=flange, face=(30, 2), neck=(32, 20, 30), bore=15)
    cone = 18 * (32**2 + 32 * 20 + 20**2) / 3
    expected = DISC * (50**2 * 12 + 30**2 * 2 + cone + 20**2 * 12 - 15**2 * 44 - 6 * 4**2 * 12)
    assert volume(mesh) == pytest.approx(expected, rel=1e-6)


def test_shaft_is_its_cylinders_without_groove_and_hole() -> None:
    steps = [("a", 20, 8), ("b", 31, 14), ("c", 11, 9)]  # each overlaps the smaller one before or starts inside it by 1
    grooves = [(30, 4, 11)]
    mesh = stepped_shaft(at=(1, 2, 3), steps=steps, key_slots=(), centre_hole=(10, 3), grooves=grooves)
    expected = DISC * (19 * 8**2 + 31 * 14**2 + 10 * 9**2 - 4 * (14**2 - 11**2) - 10 * 3**2)
    assert volume(mesh) == pytest.approx(expected, rel=1e-6)


def test_block_is_a_box_without_its_bores() -> None:
    bores = {"blind": [Drill("x", (-1, 20, 12), 31, 4)], "through": [Drill("y", (45, -1, 12), 42, 5)]}
    mesh = manifold_block(at=(3, 2, 1), size=(60, 40, 24), bores=bores, mounting=(4, 33, 2))
    expected = 60 * 40 * 24 - DISC * (30 * 4**2 + 40 * 5**2 + 4 * 24 * 2**2)
    assert volume(mesh) == pytest.approx(expected, rel=1e-6)


def test_tray_is_a_box_without_its_cavity() -> None:
    mesh = thin_tray(at=(3, 2, 1), size=(80, 50, 30), wall=2, tubes=(), dividers=(20,), divider_height=15)
    assert volume(mesh) == pytest.approx(80 * 50 * 30 - 76 * 46 * 28 + 2 * 46 * 13, rel=1e-6)


def test_heat_sink_is_its_boxes_without_screw_holes() -> None:
    mesh = heat_sink(at=(3, 2, 1), base=(80, 60, 5), fins=7, fin=(2, 25), margin=8, screws=2)
    assert volume(mesh) == pytest.approx(80 * 60 * 5 + 7 * 2 * 25 * 64 - 4 * DISC * 5 * 2**2, rel=1e-6)


def test_angle_bracket_is_its_plates_without_holes() -> None:
    mesh = angle_bracket(size=(70, 50, 40), thickness=5, seat=5, ribs=(), side=30, wall_holes=((35, 20, 6),))
    boxes = 70 * 50 * 5 + 70 * 5 * 35 + 5 * 45 * 25
    assert volume(mesh) == pytest.approx(boxes - DISC * 5 * (2 * 5.5**2 + 6**2), rel=1e-6)


def test_gear_teeth_fill_half_of_the_pitch_circle() -> None:
    mesh = as_trimesh(gear(at=(0, 0, 0), module=3, teeth=20, width=8, bore=6))
    angles = 2 * pi * (np.arange(4000) + 0.5) / 4000
    circle = np.stack([30 * np.cos(angles), 30 * np.sin(angles), np.full(4000, 4.0)], axis=1)
    filled = mesh.contains(circle)
    assert filled.mean() == pytest.approx(0.5, abs=0.01)
    assert np.count_nonzero(filled & ~np.roll(filled, 1)) == 20
    assert np.hypot(*mesh.vertices[:, :2].T).max() == pytest.approx(33, abs=1e-5)
    assert mesh.contains([[26.0, 0, 4], [26.4, 0, 4], [32.9, 0, 4]]).tolist() == [True, False, False], "root at 26.25"
