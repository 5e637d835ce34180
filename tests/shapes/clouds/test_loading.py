"""A cloud as a shape: by file and by arrays, with unit, truth and identity."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from cloud_files import as_text, on_box, ply, written
from solids import halves

from jointsdf import shapes
from jointsdf.errors import InputError
from jointsdf.shapes.clouds.loading import load_cloud_file
from jointsdf.shapes.clouds.sources import load_cloud
from jointsdf.shapes.stored import load_configured, shape_identity
from jointsdf.values import Scan, Shape

BOX = on_box()


def configured(shape: Path, **more: Any) -> dict[str, Any]:
    tessellation, paths = {"tolerance": 1e-4, "angle": 0.1}, {"abc_root": "none", "abc_missing": "error"}
    rest = {"labels": "auto", "head": {"name": "siren"}, "tessellation": tessellation, "paths": paths}
    return {"shape": str(shape), **rest, **more}


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    return written(tmp_path, "my scan.xyzc", as_text(BOX))


@pytest.fixture
def truth(tmp_path: Path) -> Path:
    mesh = halves()
    path = tmp_path / "truth.stl"
    trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(path)
    np.save(tmp_path / "truth.labels.npy", mesh.labels)
    return path


def test_a_file_gives_points_labels_and_a_name(scan: Path) -> None:
    found = load_cloud_file(scan, unit="in")
    np.testing.assert_array_equal(found.points, BOX.points)
    np.testing.assert_array_equal(found.labels, BOX.labels)
    np.testing.assert_allclose(found.normals, BOX.normals, atol=1e-15)
    assert found.name == f"my_scan-{found.points_sha256[:6]}"
    assert (found.unit.name, found.label_provider, found.part_ids.tolist()) == ("in", "file:my scan.xyzc:label", [4, 9])
    assert found.side == pytest.approx(4, rel=0.02)
    assert found.truth is None


def test_a_config_loads_it_with_its_truth_and_the_identity_holds_both(scan: Path, truth: Path) -> None:
    alone, scored, bare = (
        load_configured(configured(scan, **more))
        for more in ({}, {"truth": str(truth)}, {"truth": str(truth), "truth_labels": "none"})
    )
    assert isinstance(alone, Scan)
    assert isinstance(scored, Scan)
    assert isinstance(scored.truth, Shape)
    assert scored.truth.label_provider == "file:truth.labels.npy"
    assert scored.truth.part_ids.tolist() == [4, 9]
    identities = [shape_identity(each) for each in (alone, scored, bare)]
    assert identities[0].keys() == {"name", "points_sha256", "labels_sha256"}
    assert identities[1].keys() == {*identities[0].keys(), "truth_mesh_sha256", "truth_labels_sha256"}
    assert identities[1] != identities[2]
    assert identities[0].items() <= identities[1].items()


def test_arrays_are_a_cloud_named_by_their_content() -> None:
    found = load_cloud(points=BOX.points, normals=3 * BOX.normals, labels=BOX.labels.tolist(), unit="cm")
    again = load_cloud(points=BOX.points.tolist())
    np.testing.assert_array_equal(found.normals, BOX.normals)
    assert (found.label_provider, again.label_provider, found.unit.name) == ("array", "none", "cm")
    assert found.name.startswith("cloud-")
    assert found.name != again.name


def test_the_truth_must_be_in_the_frame_of_the_points(scan: Path, caplog: pytest.LogCaptureFixture) -> None:
    shape = Shape("halves", halves(), "0" * 64, "file", True)
    assert load_cloud_file(scan, truth=shape).truth is shape
    far = Shape("far", trimesh_moved(halves(), 30.0), "0" * 64, "file", True)
    with pytest.raises(InputError, match=r"truth=far: the points of .* are .* of the longest side away"):
        load_cloud_file(scan, truth=far)
    other = Shape("other", halves((1, 2)), "0" * 64, "file", True)
    load_cloud_file(scan, truth=other)
    assert "truth=other: none of its part ids is one of" in caplog.text


def trimesh_moved(mesh, by: float):
    return type(mesh)(mesh.vertices + by, mesh.faces, mesh.labels)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({}, "give a path, or else points="),
        ({"points": [[1, 2]]}, r"points of shape \(1, 2\)"),
        ({"points": BOX.points, "normals": BOX.normals[1:]}, r"give numbers in shape \(600, 3\)"),
        ({"points": BOX.points, "labels": [1, 2]}, "has 2 labels for 600 points"),
        ({"points": BOX.points, "labels": np.full(600, 0.5)}, "holds 0.5"),
        ({"source": "missing.xyz"}, "missing.xyz: no such file"),
        ({"source": "part_01"}, "part_01: no such file; meshes are loaded by load_shape"),
    ],
    ids=lambda value: ", ".join(value) if isinstance(value, dict) else "",
)
@pytest.mark.usefixtures("as_in_training")
def test_what_is_no_cloud_is_one_line(options: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        load_cloud(**options)


def test_a_mesh_has_no_truth_and_a_cloud_is_not_cut(scan: Path, truth: Path) -> None:
    with pytest.raises(InputError, match=r"it scores a point cloud, and shape=.*truth.stl is none"):
        load_configured(configured(truth, truth=str(truth)))
    with pytest.raises(InputError, match=r"num_parts=3: .* is a point cloud"):
        load_configured(configured(scan, num_parts=3))


def test_without_two_parts_there_is_nothing_to_learn(tmp_path: Path) -> None:
    bare = written(tmp_path, "a.xyz", as_text(BOX, normals=False, labels=False))
    with pytest.raises(InputError, match=r"a-\w{6} has no part labels: give labels=.*head=none"):
        load_configured(configured(bare))
    assert isinstance(load_configured(configured(bare, head={"name": "none"})), Scan)
    ones = written(
        tmp_path, "b.csv", ["x,y,z,label", *(f"{row} 1" for row in as_text(BOX, normals=False, labels=False))]
    )
    with pytest.raises(InputError, match="has only one part"):
        load_configured(configured(ones))


def test_where_a_mesh_is_needed_a_cloud_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is a point cloud: 600 points without faces"):
        shapes.load(str(written(tmp_path, "a.ply", ply(BOX))), abc_root=tmp_path)
