"""Simplified surfaces: exact where flat, within the bound elsewhere, the same pieces, labels and borders."""

import logging
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from labelled_meshes import EMPTY
from level_sets import drilled_box

from jointsdf.errors import InputError
from jointsdf.extraction import simplification
from jointsdf.extraction.extractor import Extraction
from jointsdf.extraction.simplification import simplify
from jointsdf.geometry.mesh import border_edges, face_areas
from jointsdf.geometry.piercings import find_piercings
from jointsdf.geometry.topology import is_closed, topology
from jointsdf.values import LabelledMesh, Normalisation

BOUND = 1e-3


def labelled(mesh: trimesh.Trimesh, labels: np.ndarray | None = None) -> LabelledMesh:
    faces = np.array(mesh.faces)
    return LabelledMesh(np.array(mesh.vertices), faces, np.zeros(len(faces), np.int64) if labels is None else labels)


def fine_box(subdivisions: int = 4) -> trimesh.Trimesh:
    mesh = trimesh.creation.box((1.0, 0.8, 0.6))
    for _ in range(subdivisions):
        mesh = mesh.subdivide()
    return mesh


def longest_side(mesh: LabelledMesh) -> float:
    return float(np.ptp(mesh.vertices, axis=0).max())


def farthest(mesh: LabelledMesh, other: LabelledMesh, count: int = 120) -> float:
    """Largest distance of random points and of vertices from another surface, every face tried by trimesh."""
    surface = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    points = trimesh.sample.sample_surface(surface, count, seed=1)[0]
    corners = np.random.default_rng(0).permutation(np.unique(mesh.faces))[:count]
    return max(
        float(
            np.linalg.norm(
                trimesh.triangles.closest_point(other.vertices[other.faces], np.tile(point, (len(other.faces), 1)))
                - point,
                axis=1,
            ).min()
        )
        for point in np.concatenate([points, mesh.vertices[corners]])
    )


def assert_kept(mesh: LabelledMesh, found: LabelledMesh) -> None:
    """Closed, with the same pieces, Euler number and outward side, without slivers and piercings."""
    one, other = topology(mesh), topology(found)
    assert is_closed(found.faces)
    assert (one["components"], one["euler"]) == (other["components"], other["euler"])
    assert other["volume"] == pytest.approx(one["volume"], rel=0.02)
    assert face_areas(found).min() > 0
    assert len(find_piercings(found.vertices, found.faces).face) == 0
    assert set(np.unique(found.faces)) == set(range(len(found.vertices)))


def test_a_fine_cube_has_twelve_faces() -> None:
    mesh = labelled(fine_box())
    found = simplify(mesh, 1e-4)
    assert len(found.faces) == 12
    assert len(mesh.faces) == 3072
    assert_kept(mesh, found)
    assert topology(found)["volume"] == pytest.approx(0.48, abs=1e-12)


@pytest.mark.parametrize(
    "solid",
    [
        trimesh.creation.cylinder(0.3, 1.0, sections=100).subdivide(),
        trimesh.creation.icosphere(3),
        trimesh.creation.torus(0.5, 0.2, major_sections=48, minor_sections=24),
    ],
    ids=["cylinder", "sphere", "torus"],
)
def test_curved_surfaces_stay_within_the_bound_from_both_sides(solid: trimesh.Trimesh) -> None:
    mesh = labelled(solid)
    found = simplify(mesh, 10 * BOUND)
    assert len(found.faces) < 0.7 * len(mesh.faces)
    assert_kept(mesh, found)
    allowed = 10 * BOUND * longest_side(mesh)
    assert farthest(mesh, found) <= allowed
    assert farthest(found, mesh) <= allowed


def test_border_in_a_plane_stays_a_straight_line() -> None:
    solid = fine_box()
    mesh = labelled(solid, np.where(np.array(solid.triangles_center)[:, 0] > 0.25, 7, 3))
    found = simplify(mesh, 1e-4)
    assert_kept(mesh, found)
    ends = found.vertices[border_edges(found)]
    assert len(ends) == 4
    np.testing.assert_allclose(ends[..., 0], 0.25, atol=1e-12)
    assert len(found.faces) == 20  # four faces of the box are rectangles of two parts, two of one
    for label in (3, 7):
        areas = [face_areas(each)[each.labels == label].sum() for each in (mesh, found)]
        assert areas[1] == pytest.approx(areas[0], rel=1e-12)


def test_a_part_of_one_face_is_kept() -> None:
    solid = fine_box()
    labels = np.zeros(len(solid.faces), dtype=np.int64)
    labels[700] = 5
    mesh = labelled(solid, labels)
    found = simplify(mesh, 1e-4)
    assert_kept(mesh, found)
    assert len(found.faces) < 40
    np.testing.assert_array_equal(
        np.sort(found.vertices[found.faces[found.labels == 5][0]], axis=0),
        np.sort(mesh.vertices[mesh.faces[700]], axis=0),
    )


def test_wavy_border_moves_by_no_more_than_the_bound() -> None:
    mesh = Extraction(32, borders="split").labelled_mesh(
        drilled_box,
        lambda points: (points[:, 1] > 0.1 * np.sin(7 * points[:, 0])).astype(np.int64),
        Normalisation(np.zeros(3), 1.0),
    )
    found = simplify(mesh, BOUND)
    assert len(found.faces) < len(mesh.faces) / 2
    assert_kept(mesh, found)
    for one, other in ((mesh, found), (found, mesh)):
        for label in (0, 1):
            part, same = (
                LabelledMesh(x.vertices, x.faces[x.labels == label], x.labels[x.labels == label]) for x in (one, other)
            )
            assert farthest(part, same, 200) <= BOUND * longest_side(mesh)


def test_where_merging_moves_too_much_it_is_undone(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    monkeypatch.setattr(simplification, "STAGES", ((1.2,),))
    mesh = labelled(trimesh.creation.torus(0.5, 0.2, major_sections=48, minor_sections=24))
    found = simplify(mesh, 10 * BOUND)
    assert "restored" in caplog.text, "no test: nothing was wrong"
    assert len(found.faces) < len(mesh.faces)
    assert_kept(mesh, found)
    assert max(farthest(mesh, found), farthest(found, mesh)) <= 10 * BOUND * longest_side(mesh)


def test_rim_of_an_open_surface_stays() -> None:
    solid = fine_box()
    kept = np.array(solid.triangles_center)[:, 2] < 0.29
    mesh = LabelledMesh(np.array(solid.vertices), np.array(solid.faces)[kept], np.zeros(kept.sum(), dtype=np.int64))
    found = simplify(mesh, 1e-4)
    assert len(found.faces) < len(mesh.faces) / 4
    rims = []
    for each in (mesh, found):
        rim = trimesh.Trimesh(each.vertices, each.faces, process=False)
        open_edges = rim.edges_sorted[trimesh.grouping.group_rows(rim.edges_sorted, require_count=1)]
        rims.append({frozenset(map(tuple, each.vertices[edge])) for edge in open_edges})
    assert rims[0] == rims[1]
    assert len(rims[0]) > 0


def test_two_boxes_with_one_edge_in_common_keep_it() -> None:
    one, other = fine_box(2), fine_box(2)
    other.apply_translation([1.0, 0.8, 0.0])
    both = trimesh.util.concatenate([one, other])
    both.merge_vertices()
    mesh = labelled(both)
    assert not is_closed(mesh.faces), "no test: the common edge has two faces"
    found = simplify(mesh, 1e-4)
    assert topology(found)["euler"] == topology(mesh)["euler"]
    assert topology(found)["volume"] == pytest.approx(0.96, rel=1e-12)
    assert len(found.faces) < len(mesh.faces)


def test_the_same_mesh_every_time() -> None:
    mesh = labelled(trimesh.creation.torus(0.5, 0.2))
    first, second = simplify(mesh, BOUND), simplify(replace(mesh), BOUND)
    np.testing.assert_array_equal(first.faces, second.faces)
    np.testing.assert_array_equal(first.vertices, second.vertices)


def test_nothing_to_do_changes_nothing() -> None:
    mesh = labelled(fine_box(1))
    assert simplify(mesh, 0) is mesh
    assert simplify(EMPTY, 1e-4) is EMPTY


def test_extraction_simplifies_last() -> None:
    sheet = Normalisation(np.array([5.0, 0.0, 0.0]), 20.0)
    label = lambda points: (points[:, 0] > 0.3).astype(np.int64)  # noqa: E731
    plain, fewer = (
        Extraction(32, borders="split", simplify=bound).labelled_mesh(drilled_box, label, sheet) for bound in (0, BOUND)
    )
    again = simplify(plain, BOUND)
    np.testing.assert_array_equal(fewer.faces, again.faces)
    np.testing.assert_array_equal(fewer.labels, again.labels)
    assert len(fewer.faces) < len(plain.faces) / 2


@pytest.mark.parametrize("wrong", [-1e-4, 0.02, 1, float("nan")])
def test_a_bound_out_of_range_names_the_fix(wrong: int | float) -> None:
    with pytest.raises(InputError, match=rf"^extraction\.simplify={wrong}: give a number, from 0 to 0.01$"):
        Extraction(simplify=wrong)
