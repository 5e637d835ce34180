"""The record of the mesh that a label file belongs to."""

import json
from pathlib import Path

import numpy as np
import pytest
from labelled_meshes import sphere
from mesh_files import BOX, SIDES, exported, load, put

from jointsdf.errors import InputError
from jointsdf.shapes.labels.face_order import find_other_mesh, order_record
from jointsdf.values import LabelledMesh
from jointsdf.viewing.export import write_mesh

MESH = LabelledMesh(np.array(BOX.vertices), np.array(BOX.faces), SIDES)
CORNERS = MESH.vertices[MESH.faces]


@pytest.fixture
def labels(tmp_path: Path) -> Path:
    write_mesh(tmp_path, MESH)
    return tmp_path / "labels.npy"


def test_the_same_faces_are_known_in_any_frame_and_precision(labels: Path) -> None:
    for same in (CORNERS, CORNERS * 25.4 - 3, CORNERS.astype(np.float32).astype(float), CORNERS[:, [1, 2, 0]]):
        assert find_other_mesh(labels, same) is None


def test_two_faces_exchanged_are_another_order(labels: Path) -> None:
    for first in range(11):
        order = np.arange(12)
        order[[first, first + 1]] = first + 1, first
        assert find_other_mesh(labels, CORNERS[order]) == "mesh.ply"
    assert find_other_mesh(labels, CORNERS[:11]) == "mesh.ply"
    moved = CORNERS.copy()
    moved[3, 1] += 1e-3
    assert find_other_mesh(labels, moved) == "mesh.ply"


def test_large_meshes_are_known_by_some_of_their_faces(tmp_path: Path) -> None:
    ball = sphere(2.0)
    write_mesh(tmp_path, ball)
    corners = ball.vertices[ball.faces]
    assert len(corners) == 5120
    assert (tmp_path / "labels.json").stat().st_size < 30_000
    assert find_other_mesh(tmp_path / "labels.npy", corners) is None
    for other in (corners[::-1], np.roll(corners, 1, axis=0), corners[np.argsort(ball.labels, kind="stable")]):
        assert find_other_mesh(tmp_path / "labels.npy", other) == "mesh.ply"


def test_another_number_of_equal_faces_is_another_mesh(tmp_path: Path) -> None:
    equal = np.repeat(CORNERS[:1], 600, axis=0)
    path = put(tmp_path, "labels.npy", "any")
    put(tmp_path, "labels.json", order_record("mesh.ply", path.name, b"any", equal))
    assert find_other_mesh(path, equal) is None
    assert find_other_mesh(path, equal[1:]) == "mesh.ply"


@pytest.mark.parametrize("case", ["own labels", "no record", "renamed", "another record", "damaged", "a list"])
def test_labels_without_a_record_of_theirs_count_by_their_length(labels: Path, case: str) -> None:
    record = labels.with_name("labels.json")
    if case == "own labels":
        np.save(labels, SIDES[::-1])
    elif case == "no record":
        record.unlink()
    elif case == "renamed":
        labels = labels.rename(labels.with_name("mine.npy"))
        record.rename(labels.with_suffix(".json"))
    elif case == "another record":
        record.write_text(json.dumps({"format": "x", "labels": "labels.npy"}))
    elif case == "damaged":
        record.write_text(record.read_text()[:-20])
    else:
        record.write_text("[1]")
    assert find_other_mesh(labels, CORNERS[::-1]) is None


def test_labels_are_refused_for_another_order_by_name(labels: Path, caplog: pytest.LogCaptureFixture) -> None:
    stl = put(labels.parent, "a.stl", exported("stl"))
    assert load(stl, labels=str(labels)).mesh.labels.tolist() == SIDES.tolist()
    turned = put(labels.parent, "b.stl", BOX.submesh([np.arange(12)[::-1]], append=True).export(file_type="stl"))
    with pytest.raises(InputError, match=r"follows the faces of mesh.ply, .*: give labels=.*mesh.ply") as caught:
        load(turned, labels=str(labels))
    assert "\n" not in str(caught.value)
    assert load(turned, labels=str(labels.with_name("mesh.ply"))).mesh.labels.tolist() == SIDES[::-1].tolist()
    caplog.clear()
    assert load(turned).label_provider.startswith("geometric")
    assert "labels.npy beside it follows the faces of mesh.ply and is passed over" in caplog.text
