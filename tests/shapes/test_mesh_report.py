import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from jointsdf import shapes
from jointsdf.shapes.arrays import from_arrays
from jointsdf.shapes.mesh_report import MeshReport, mesh_report
from jointsdf.shapes.repair import repair_mesh
from jointsdf.values import LabelledMesh, Shape, Unit


def report_on(mesh: trimesh.Trimesh, labels: np.ndarray | None = None) -> MeshReport:
    solid = repair_mesh("it", np.array(mesh.vertices), np.array(mesh.faces))
    labels = np.zeros(len(solid.faces), dtype=np.int64) if labels is None else labels
    shape = Shape(
        "it", LabelledMesh(solid.vertices, solid.faces, labels), "", "builtin", solid.watertight, folded=solid.folded
    )
    return mesh_report(shape)


def plate(thickness: float) -> trimesh.Trimesh:
    return trimesh.creation.box((20.0, 20.0, thickness))


def moved(*offset: float, size: float = 1.0) -> trimesh.Trimesh:
    return trimesh.creation.box((size,) * 3, transform=trimesh.transformations.translation_matrix(offset))


@pytest.mark.parametrize("thickness", [0.01, 0.5, 3.0])
def test_wall_of_a_plate_is_its_thickness(thickness: float) -> None:
    report = report_on(plate(thickness))
    assert report.wall == pytest.approx(thickness, rel=2e-3)
    assert (report.faces, report.components, report.watertight, report.contacts) == (12, 1, True, 0.0)


def test_wall_is_the_thinnest_one_with_a_share_of_the_surface() -> None:
    tube = trimesh.creation.annulus(r_min=9.0, r_max=10.0, height=30.0, sections=128)
    assert report_on(tube).wall == pytest.approx(1.0, rel=2e-3)
    hollow = trimesh.creation.box((10, 10, 10))
    inner = trimesh.creation.box((9, 9, 9), transform=trimesh.transformations.translation_matrix((0, 0, 0.3)))
    inner.invert()
    assert report_on(trimesh.util.concatenate([hollow, inner])).wall == pytest.approx(0.2, rel=1e-2)


def test_the_report_is_logged_with_the_wall_in_cells(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    report = report_on(plate(0.1))
    report.log(0.05)
    assert [record.getMessage() for record in caplog.records] == report.lines(0.05)
    assert "thinnest wall 0.1 mm, 2.0 cells of the grid" in caplog.text


def test_the_unit_is_said_once_and_whether_it_is_known() -> None:
    report = report_on(plate(0.1))
    assert report.lines(0.05)[0].endswith(", watertight, unit mm (assumed; unit=in says otherwise)")
    assert (report.facts()["unit"], report.facts()["unit_known"]) == ("mm", False)
    known = replace(report, unit=Unit("in", 0.0254))
    assert known.lines(0.05)[0].endswith(", watertight, unit in")
    assert "0.1 in, 2.0 cells" in known.lines(0.05)[3]


def test_bodies_that_overlap_are_told_by_the_surface_inside() -> None:
    both = trimesh.util.concatenate([moved(0, 0, 0), moved(0.5, 0.5, 0.5)])
    report = report_on(both)
    # An eighth of each cube is common: of each, three faces lie inside the other with a quarter of their area.
    assert report.buried == pytest.approx(3 * 0.25 / 6, abs=0.02)
    assert report.components == 2
    assert any("of the surface lies inside the solid" in line for line in report.warnings())
    assert report_on(trimesh.util.concatenate([moved(0, 0, 0), moved(3, 0, 0)])).buried == 0.0


def test_welded_corners_and_cavities_are_counted() -> None:
    corners = trimesh.creation.icosphere(2).triangles.reshape(-1, 3)
    corners = corners + np.random.default_rng(0).uniform(-1e-7, 1e-7, corners.shape)
    hole = trimesh.creation.icosphere(1, 0.3)
    faces = np.concatenate([np.arange(len(corners)).reshape(-1, 3), hole.faces + len(corners)])
    shape = from_arrays(np.concatenate([corners, hole.vertices]), faces, labels="none", name="it")
    lines = mesh_report(shape).lines(0.1)
    assert shape.welded == len(corners) - 162
    assert lines[0] == "it: 400 faces, 2 components (1 a cavity), watertight, unit mm (assumed; unit=in says otherwise)"
    assert lines[1] == f"  repairs       80 faces flipped, 0 dropped, {shape.welded} vertices welded"


def test_faces_within_are_told_and_cavities_are_not() -> None:
    outer, inner = moved(0, 0, 0, size=2.0), moved(0, 0, 0, size=1.0)
    for cavity in (inner, inner.copy()):
        assert report_on(trimesh.util.concatenate([outer, cavity])).buried == 0.0
        inner.invert()
    wall = trimesh.Trimesh([[0, -1, -1], [0, 1, -1], [0, 1, 1], [0, -1, 1]], [[0, 1, 2], [0, 2, 3]])
    split = trimesh.util.concatenate([outer, wall])
    report = report_on(split)
    assert not report.watertight
    assert report.buried == pytest.approx(4 / 28, abs=0.03)


@pytest.mark.parametrize(("gap", "suspect"), [(2e-5, True), (1e-3, False)])
def test_a_narrow_gap_is_suspected(gap: float, suspect: bool) -> None:
    pair = trimesh.util.concatenate([moved(0, 0, 0), moved(1.0 + gap, 0, 0)])
    report = report_on(pair)
    assert (report.contacts > 0) == suspect
    if suspect:
        assert report.contacts == pytest.approx(2 / 12, abs=0.02)
        assert any("nearly touches" in line for line in report.warnings())


def test_a_clean_ball_and_an_open_shell_have_nothing_to_warn_of() -> None:
    ball = trimesh.creation.icosphere(subdivisions=4)
    assert report_on(ball).warnings() == []
    ball.update_faces(ball.triangles_center[:, 2] < 0)
    assert report_on(ball).warnings() == []
    assert not report_on(ball).watertight


def test_parts_are_listed_by_falling_area_on_one_screen() -> None:
    box = trimesh.creation.box((1.0, 2.0, 5.0))
    report = report_on(
        box, labels=np.where(np.abs(box.face_normals[:, 0]) > 0.5, 7, np.where(box.area_faces > 1.5, -1, 3))
    )
    assert [part for part, _ in report.parts] == [7, 3]
    assert [share for _, share in report.parts] == pytest.approx([20 / 34, 4 / 34])
    assert report.lines(0.1)[-1] == "  parts         2 (7: 58.8%, 3: 11.8%)"
    many = trimesh.creation.icosphere(subdivisions=3)
    lines = report_on(many, labels=np.arange(len(many.faces))).lines(0.1)
    assert len(lines) == 5
    assert lines[-1].endswith(f"and {len(many.faces) - 24} more)")


def test_repairs_of_a_file_are_counted(tmp_path: Path) -> None:
    box = trimesh.creation.box((1.0, 2.0, 5.0))
    faces = box.faces.copy()
    faces[:2] = faces[:2, ::-1]
    faces = np.concatenate([faces, faces[4:7]])
    (tmp_path / "a.ply").write_bytes(trimesh.Trimesh(box.vertices, faces, process=False).export(file_type="ply"))
    shape = shapes.load(str(tmp_path / "a.ply"), labels="none", segmented=False, abc_root="nowhere")
    report = mesh_report(shape)
    assert (report.faces, report.watertight, report.flipped, report.dropped) == (12, True, 2, 3)
    assert report.counts() == {"components_gt": 1, "flipped_gt": 2, "dropped_gt": 3}
    assert report.lines(0.1)[1] == "  repairs       2 faces flipped, 3 dropped, 0 vertices welded"
    assert report.lines(0.1)[-1] == "  parts         0"
    assert set(report.facts()) == {"watertight", "near_contact", "inside_solid", "thinnest_wall", "unit", "unit_known"}


def test_the_report_does_not_depend_on_unit_and_place() -> None:
    mesh = trimesh.creation.annulus(r_min=3.0, r_max=4.0, height=2.0)
    here = report_on(mesh)
    mesh.apply_scale(1e3)
    mesh.apply_translation([1e4, -2e4, 5e3])
    there = report_on(mesh)
    assert there.wall == pytest.approx(1e3 * here.wall, rel=1e-3)
    assert (there.contacts, there.buried) == (here.contacts, here.buried)
