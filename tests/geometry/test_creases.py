"""Creases of solids and sheets whose angles, lengths and widths are known."""

import numpy as np
import pytest
import trimesh
from labelled_meshes import EMPTY
from profiles import fillet, hinge, sheet
from solids import labelled

from jointsdf.geometry.creases import Creases, find_creases
from jointsdf.values import LabelledMesh

REACH = 0.002
CUBE = labelled(trimesh.creation.box((1, 1, 1)))


def length_of(found: Creases) -> float:
    return float(np.linalg.norm(found.ends - found.starts, axis=1).sum())


def assert_cube(found: Creases, scale: float = 1.0) -> None:
    assert length_of(found) == pytest.approx(12 * scale, rel=1e-9)
    np.testing.assert_allclose(np.degrees(found.angles), 90, atol=1e-6)
    on_faces = np.isclose(np.abs(found.starts + found.ends) / 2, scale / 2, atol=1e-9 * scale).sum(axis=1)
    assert (on_faces == 2).all()


@pytest.mark.parametrize("scale", [1.0, 1e-3, 1e4])
def test_a_cube_has_twelve_edges_of_ninety_degrees_in_any_unit_and_in_faces_of_any_size(scale: float) -> None:
    for solid in (trimesh.creation.box((1, 1, 1)), trimesh.creation.box((1, 1, 1)).subdivide_to_size(0.05)):
        solid.apply_scale(scale)
        found = find_creases(labelled(solid), REACH * scale)
        assert_cube(found, scale)
        edges = np.sort(solid.vertices[found.edges], axis=1)
        middles = (found.starts + found.ends) / 2
        assert (edges[:, 0] - 1e-9 * scale <= middles).all()  # the mesh edge that is named holds the piece
        assert (middles <= edges[:, 1] + 1e-9 * scale).all()


@pytest.mark.parametrize(("degrees", "found"), [(10, 0), (31.9, 0), (32.1, 1), (60, 1), (-90, 1), (135, 1), (175, 1)])
def test_a_hinge_has_its_angle_on_either_side_from_32_degrees_and_its_borders_are_none(degrees: float, found) -> None:
    creases = find_creases(hinge(degrees), REACH)
    assert length_of(creases) == pytest.approx(found)
    np.testing.assert_allclose(np.degrees(creases.angles), abs(degrees), atol=1e-6)
    assert np.abs(creases.starts[:, [0, 2]]).max(initial=0) == 0


@pytest.mark.parametrize("sections", [12, 24, 96])
def test_the_side_of_a_cylinder_is_smooth_and_its_rims_are_not(sections: int) -> None:
    found = find_creases(labelled(trimesh.creation.cylinder(0.5, 1.0, sections=sections)), REACH)
    assert length_of(found) == pytest.approx(2 * sections * np.sin(np.pi / sections), rel=1e-6)
    np.testing.assert_allclose(np.abs(found.starts[:, 2]), 0.5, atol=1e-9)


def test_an_octagonal_prism_has_creases_along_its_side() -> None:
    found = find_creases(labelled(trimesh.creation.cylinder(0.5, 1.0, sections=8)), REACH)
    along = np.abs((found.ends - found.starts)[:, 2]) > 0
    np.testing.assert_allclose(np.degrees(found.angles[along]), 45, atol=1e-6)
    assert np.linalg.norm((found.ends - found.starts)[along], axis=1).sum() == pytest.approx(8)


@pytest.mark.parametrize("mesh", [labelled(trimesh.creation.icosphere(4, 0.5)), EMPTY, sheet([(0, 0), (1, 0)])])
def test_smooth_flat_and_empty_meshes_have_none(mesh: LabelledMesh) -> None:
    assert len(find_creases(mesh, REACH).starts) == 0


@pytest.mark.parametrize("width", [0.0002, 0.001, 0.003, 0.05])
def test_a_chamfer_counts_by_its_width_against_the_reach(width: float) -> None:
    """Both its edges see the mean of the normals over the reach: of the chamfer alone where it is wider."""
    side = width / np.sqrt(2)
    found = find_creases(sheet([(-1, 0), (0, 0), (side, side), (side, 1 + side)]), REACH)
    share = min(width / REACH, 1)
    mean = share * np.array([-1, 1]) / np.sqrt(2) + (1 - share) * np.array([-1, 0])
    np.testing.assert_allclose(np.degrees(found.angles), np.degrees(np.arctan2(-mean[0], mean[1])), atol=1e-6)
    assert length_of(found) == pytest.approx(2)


@pytest.mark.parametrize(("radius", "crease"), [(0.0033, True), (0.004, False), (0.01, False)])
def test_a_fillet_is_a_crease_if_it_turns_by_32_degrees_within_the_reach(radius: float, crease: bool) -> None:
    """Between its middle and either side normals are turned by reach / radius on average: 32 degrees at 1.79."""
    assert (length_of(find_creases(fillet(radius, 11), REACH)) > 0) == crease


def test_a_step_lower_than_the_reach_is_averaged_away() -> None:
    low, high = (find_creases(sheet([(-1, 0), (0, 0), (0, rise), (1, rise)]), REACH) for rise in (0.0005, 0.01))
    assert (length_of(low), length_of(high)) == pytest.approx((0, 2))


def test_a_sliver_of_another_direction_is_no_crease() -> None:
    flat = find_creases(sheet([(-1, 0), (0, 0), (1e-7, 3e-7), (1, 3e-7)]), REACH)
    assert len(flat.starts) == 0
    beside = find_creases(sheet([(-1, 0), (0, 0), (1e-7, 3e-7), (1e-7, 1)]), REACH)
    np.testing.assert_allclose(np.degrees(beside.angles), 90, atol=0.1)


def needles(mesh: LabelledMesh) -> LabelledMesh:
    """The mesh with every face cut off its neighbours at the first side, and the slit closed by faces without area."""
    faces, vertices = mesh.faces.copy(), mesh.vertices
    end, start = faces[0, 1], faces[0, 0]
    vertices = np.concatenate([vertices, vertices[[start]]])
    faces[0, 0] = len(vertices) - 1  # the face's own copy of one corner
    previous = np.array([[faces[0, 0], start, end], [faces[0, 2], start, faces[0, 0]]])
    faces = np.concatenate([faces, previous])
    return LabelledMesh(vertices, faces, np.zeros(len(faces), dtype=np.int64))


def test_faces_without_area_twice_or_turned_change_nothing() -> None:
    assert_cube(find_creases(needles(CUBE), REACH))
    twice = np.concatenate([CUBE.faces, CUBE.faces[:3], CUBE.faces[5:7, ::-1]])
    assert_cube(find_creases(LabelledMesh(CUBE.vertices, twice, np.zeros(len(twice), dtype=np.int64)), REACH))
    turned = np.where((np.arange(12) % 3 == 0)[:, None], CUBE.faces[:, ::-1], CUBE.faces)
    assert_cube(find_creases(LabelledMesh(CUBE.vertices, turned, CUBE.labels), REACH))


def test_faces_that_disagree_about_the_outside_give_the_same_angle() -> None:
    """A hinge of 60 degrees in strips narrower than the reach, every second or third face turned."""
    steps = np.array([-0.004, -0.0013, -0.0006, 0, 0.0006, 0.0013, 0.004])
    turn = np.where((steps > 0)[:, None], [np.cos(np.pi / 3), np.sin(np.pi / 3)], [1, 0])
    mesh = sheet(steps[:, None] * turn, 0.004)
    for every in (2, 3):
        turned = np.where((np.arange(len(mesh.faces)) % every == 0)[:, None], mesh.faces[:, ::-1], mesh.faces)
        found = find_creases(LabelledMesh(mesh.vertices, turned, mesh.labels), REACH)
        np.testing.assert_allclose(np.degrees(found.angles), 60, atol=1e-6)
        assert length_of(found) == pytest.approx(0.004)


def test_an_edge_of_two_bodies_is_one_crease() -> None:
    """Two cubes that share an edge, an edge of four faces."""
    other = np.array(CUBE.vertices) + np.array([1, 1, 0])
    vertices, which = np.unique(np.concatenate([CUBE.vertices, other]).round(9), axis=0, return_inverse=True)
    faces = which[np.concatenate([CUBE.faces, CUBE.faces + 8])]
    found = find_creases(LabelledMesh(vertices, faces, np.zeros(24, dtype=np.int64)), REACH)
    assert length_of(found) == pytest.approx(23)


def test_thin_walls_keep_their_creases() -> None:
    """A plate thinner than the reach: the sections of its edges go round to the other side."""
    found = find_creases(labelled(trimesh.creation.box((1, 1, 0.0005))), REACH)
    assert length_of(found) == pytest.approx(8 + 4 * 0.0005)
    assert np.degrees(found.angles).min() > 89


def test_order_of_faces_is_without_meaning() -> None:
    solid = labelled(trimesh.creation.cylinder(0.5, 1.0, sections=24))
    order = np.random.default_rng(0).permutation(len(solid.faces))
    mixed = LabelledMesh(solid.vertices, np.roll(solid.faces[order], 1, axis=1), solid.labels)
    one, other = find_creases(solid, REACH), find_creases(mixed, REACH)
    np.testing.assert_allclose(np.sort(one.starts + one.ends, axis=0), np.sort(other.starts + other.ends, axis=0))
    np.testing.assert_allclose(np.sort(one.angles), np.sort(other.angles))
