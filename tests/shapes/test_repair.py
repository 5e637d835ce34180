"""Repairs of odd meshes, and their warnings."""

import logging
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from mesh_files import BOX, OBJ, OFF, exported, flipped, load, put, signed_volume

from jointsdf.shapes import repair


def two_boxes() -> bytes:
    return trimesh.util.concatenate([trimesh.creation.box(), BOX]).export(file_type="ply")


ODD_MESHES: dict[str, tuple[str, Callable[[], bytes | str], str, bool, float]] = {
    "clean": ("a.ply", lambda: exported("ply"), "", True, 24),
    "hole": ("a.obj", lambda: OBJ[: OBJ.rindex("f")], "not watertight (3 of 6 edges", False, 1 / 6),
    "components": ("a.ply", two_boxes, "2 separate components", True, 25),
    "inside out": ("a.ply", flipped(12), "inside out (negative volume): all faces flipped", True, 24),
    "few faces inside out": ("a.ply", flipped(2), "2 faces were inside out", True, 24),
    "most faces inside out": ("a.ply", flipped(9), "all faces flipped", True, 24),
    "degenerate": ("a.obj", lambda: OBJ + "f 1 1 2\nf 2 2 2\n", "2 degenerate faces", True, 1 / 6),
    "few faces": ("a.off", lambda: OFF, "very coarse (4 faces)", True, 1 / 6),
    "unused vertex": ("a.obj", lambda: OBJ + "v 100 100 100\n", "very coarse", True, 1 / 6),
}


@pytest.mark.parametrize("case", ODD_MESHES)
def test_odd_mesh_is_loaded_with_a_warning(tmp_path: Path, caplog: pytest.LogCaptureFixture, case: str) -> None:
    name, content, message, watertight, volume = ODD_MESHES[case]
    shape = load(put(tmp_path, name, content()))
    assert message in caplog.text
    assert bool(caplog.records) == bool(message)
    assert all(record.levelno == logging.WARNING and "\n" not in record.getMessage() for record in caplog.records)
    assert shape.watertight is watertight
    if case != "hole":
        assert signed_volume(shape) == pytest.approx(volume, rel=1e-6)
    assert len(np.unique(shape.mesh.faces)) == len(shape.mesh.vertices), "no vertex without a face"


def test_labels_of_degenerate_faces_go_with_them(tmp_path: Path) -> None:
    lines = OBJ.splitlines(keepends=True)
    path = put(tmp_path, "a.obj", "".join([*lines[:4], "f 1 1 2\n", *lines[4:6], "f 3 3 3\n", *lines[6:]]))
    np.save(tmp_path / "labels.npy", np.array([9, 5, 5, 8, 2, -1]))
    assert load(path).mesh.labels.tolist() == [5, 5, 2, -1]


def test_closed_mesh_that_touches_itself_stays_closed(tmp_path: Path) -> None:
    other = trimesh.creation.box(transform=trimesh.transformations.translation_matrix((1, 1, 0)))
    both = trimesh.util.concatenate([trimesh.creation.box(), other])
    shape = load(put(tmp_path, "a.off", both.export(file_type="off")))
    assert (shape.watertight, len(shape.mesh.vertices)) == (True, 16)


def test_one_sided_surface_is_not_taken_for_watertight(caplog: pytest.LogCaptureFixture) -> None:
    faces = np.array(  # the projective plane with 6 vertices: closed, and without an outside
        [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5], [0, 5, 1], [1, 2, 4], [2, 3, 5], [3, 4, 1], [4, 5, 2], [5, 1, 3]]
    )
    solid = repair.repair_mesh("it", np.random.default_rng(0).random((6, 3)), faces)
    assert not solid.watertight
    assert "one-sided" in caplog.text
    assert "inside out" not in caplog.text
    assert solid.flipped == 0


def test_two_million_faces_warn(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    assert repair.SLOW == 2_000_000
    monkeypatch.setattr(repair, "SLOW", 12)
    repair.repair_mesh("it", np.array(BOX.vertices), np.array(BOX.faces))
    assert "it: 12 faces: distances and measures will be slow" in caplog.text


def test_repeated_faces_are_dropped_with_their_labels(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    lines = OBJ.splitlines(keepends=True)
    path = put(tmp_path, "a.obj", "".join([*lines, "f 3 2 1\n", lines[5], "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 5 7 6\n"]))
    np.save(tmp_path / "labels.npy", np.array([9, 5, 8, 2, 9, 1, 7]))
    shape = load(path)
    assert "3 repeated faces dropped with their labels" in caplog.text
    assert (shape.watertight, shape.mesh.labels.tolist()) == (True, [9, 5, 8, 2])
    assert signed_volume(shape) == pytest.approx(1 / 6)
    assert (shape.flipped, shape.dropped) == (0, 3)


def test_a_body_that_is_there_twice_is_kept_once(tmp_path: Path) -> None:
    twice = trimesh.util.concatenate([BOX, BOX])
    shape = load(put(tmp_path, "a.off", twice.export(file_type="off")))
    assert (shape.watertight, len(shape.mesh.faces), len(shape.mesh.vertices)) == (True, 12, 8)


def test_flipped_faces_are_counted(tmp_path: Path) -> None:
    assert load(put(tmp_path, "a.ply", flipped(3)())).flipped == 3
    assert load(put(tmp_path, "b.ply", flipped(12)())).flipped == 12
    assert load(put(tmp_path, "c.ply", exported("ply"))).flipped == 0


def test_non_manifold_edges_take_the_winding_number(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    fin = trimesh.Trimesh(
        [*BOX.vertices, [9.0, 9, 9]], [*BOX.faces, [BOX.faces[0][0], BOX.faces[0][1], 8]], process=False
    )
    shape = load(put(tmp_path, "a.ply", fin.export(file_type="ply")))
    assert not shape.watertight
    assert (
        "not watertight (3 of 20 edges do not have exactly two faces): the sign comes from the winding" in caplog.text
    )
    assert len(shape.mesh.part_ids) >= 2, "parts by geometry all the same"


def test_faces_know_their_place_among_the_given_ones() -> None:
    faces = np.insert(np.array(BOX.faces), [1, 4], [BOX.faces[0], [3, 3, 5]], axis=0)  # repeated, degenerate
    solid = repair.repair_mesh("it", np.array(BOX.vertices), faces)
    np.testing.assert_array_equal(solid.source_faces, np.delete(np.arange(14), [1, 5]))
