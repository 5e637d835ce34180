"""Labels from labelled points."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from mesh_files import BOX, SIDES, put

from jointsdf.errors import InputError
from jointsdf.shapes.labels.point_files import read_point_labels
from jointsdf.shapes.readers.file_mesh import FileMesh

FINE = BOX.subdivide().subdivide()
MESH = FileMesh(np.array(BOX.vertices), np.array(BOX.faces))


def side_of(normals: np.ndarray) -> np.ndarray:
    """The number that `SIDES` gives to the side of each normal."""
    return SIDES[np.argmax(normals @ BOX.face_normals.T, axis=1)]


def lines(points: np.ndarray, *columns: np.ndarray) -> str:
    return "".join(" ".join(f"{x:.9g}" for x in row) + "\n" for row in np.column_stack([points, *columns]))


@pytest.mark.parametrize("with_normals", [False, True])
def test_faces_take_the_label_of_the_points_on_them(
    tmp_path: Path, with_normals: bool, caplog: pytest.LogCaptureFixture
) -> None:
    points, faces = trimesh.sample.sample_surface(FINE, 2000, seed=1)
    normals = FINE.face_normals[faces]
    columns = (normals, side_of(normals)) if with_normals else (side_of(normals),)
    fine = FileMesh(np.array(FINE.vertices), np.array(FINE.faces))
    found = read_point_labels(put(tmp_path, "a.xyzc", lines(points, *columns)), fine)
    assert found.tolist() == side_of(FINE.face_normals).tolist()
    assert not caplog.records


def test_faces_without_points_near_them_are_named(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    centres, labels = FINE.triangles_center, side_of(FINE.face_normals)
    kept = np.linalg.norm(centres - centres[40], axis=1) > 0.7  # of a box with longest side 4
    fine = FileMesh(np.array(FINE.vertices), np.array(FINE.faces))
    read_point_labels(put(tmp_path, "a.xyzc", lines(centres[kept], labels[kept])), fine)
    reach = np.linalg.norm(centres[:, None] - centres[kept], axis=2).min(axis=1)
    assert 0.4 < reach.max() < 0.8
    assert f"{(reach > 0.4).sum()} faces have no point within 0.1 of the longest side" in caplog.text


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (lines(BOX.triangles_center * 2, SIDES), "is of another mesh: its points lie up to"),
        (lines(BOX.triangles_center + 0.1, SIDES), "is of another mesh"),
        (lines(BOX.triangles_center), "has 3 numbers in each line: write x y z class"),
        (lines(BOX.triangles_center, SIDES + 0.5), "holds 0.5: part ids are integers"),
        (lines(BOX.triangles_center, np.full(12, 2**31)), "holds 2147483650"),
        ("1e999 0 0 1\n", "infinite"),
        ("", "is empty"),
    ],
)
def test_bad_points_are_one_line(tmp_path: Path, content: str, message: str) -> None:
    path = put(tmp_path, "a.xyzc", content)
    with pytest.raises(InputError) as caught:
        read_point_labels(path, MESH)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
