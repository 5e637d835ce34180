"""Shapes by name, catalogue and path."""

import os
from pathlib import Path

import numpy as np
import pytest
import trimesh
from mesh_files import exported, load, put, signed_volume

from jointsdf.errors import InputError
from jointsdf.shapes import abc
from jointsdf.shapes.labels import providers

NEEDS_ABC = pytest.mark.skipif(not os.environ.get("JOINTSDF_ABC"), reason="JOINTSDF_ABC names no folder of ABC meshes")


@pytest.mark.parametrize(
    ("typo", "near"), [("abc_001", "abc_0001"), ("part01", "part_01"), ("abc_013", "abc_0013"), ("xyz", "part_01")]
)
def test_typo_lists_near_names(typo: str, near: str) -> None:
    with pytest.raises(InputError, match=f"unknown shape '{typo}': near names are .*{near}"):
        load(typo)


def test_missing_abc_mesh_falls_back_under_the_own_name(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    shape = load("abc_0001", abc_root=tmp_path, segmented=True, labels="brep")
    assert (shape.name, shape.label_provider) == ("part_01", "builtin")
    assert shape.mesh_sha256 == load("part_01").mesh_sha256
    [record] = caplog.records
    for words in (str(tmp_path / "abc_0001" / "mesh.ply"), "paths.abc_root", "JOINTSDF_ABC", "00000003_", "part_01"):
        assert words in record.getMessage()


def test_missing_abc_mesh_can_be_forbidden(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="abc_0001 is not on this machine"):
        load("abc_0001", abc_root=tmp_path, abc_missing="error")
    with pytest.raises(InputError, match="unknown abc_missing='skip': give one of fallback, error"):
        load("abc_0001", abc_root=tmp_path, abc_missing="skip")


def test_catalogue_shape_has_the_benchmarks_number_of_parts(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    sphere = trimesh.creation.icosphere(subdivisions=2)
    (tmp_path / "abc_0007").mkdir()
    path = put(tmp_path, "abc_0007/mesh.ply", sphere.export(file_type="ply"))
    np.save(path.with_name("patches.npy"), np.arange(320) // 4)
    shape = load("abc_0007", abc_root=tmp_path, segmented=True)
    assert f"sha256 {shape.mesh_sha256}" in caplog.text
    assert abc.catalogue()["abc_0007"].sha256 in caplog.text
    count = providers.benchmark()["abc_0007"]
    assert (shape.name, shape.label_provider) == ("abc_0007", f"geometric:k={count}")
    assert shape.mesh.part_ids.tolist() == list(range(count))
    assert load("abc_0007", abc_root=tmp_path, labels="geometric").label_provider == f"geometric:k={count}"
    for many in (2, 5, 40):
        assert load("abc_0007", abc_root=tmp_path, num_parts=many).mesh.part_ids.tolist() == list(range(many))
    assert len(load("abc_0007", abc_root=tmp_path, labels="brep").mesh.part_ids) == 80
    np.save(path.with_name("labels.npy"), np.arange(320) // 5)
    assert len(load("abc_0007", abc_root=tmp_path).mesh.part_ids) == 64


@NEEDS_ABC
@pytest.mark.parametrize("name", abc.catalogue())
def test_real_shape_loads_with_the_catalogue_facts(name: str, caplog: pytest.LogCaptureFixture) -> None:
    root = os.environ["JOINTSDF_ABC"]
    if not abc.mesh_path(name, root).is_file():
        pytest.skip(f"{name} is not under JOINTSDF_ABC")
    shape = load(name, abc_root=root, segmented=True)
    assert "sha256" not in caplog.text
    assert (shape.name, shape.mesh_sha256, shape.watertight) == (name, abc.catalogue()[name].sha256, True)
    assert signed_volume(shape) > 0
    assert shape.mesh.part_ids.tolist() == list(range(providers.benchmark()[name]))
    assert shape.label_provider == f"geometric:k={len(shape.mesh.part_ids)}"


@pytest.mark.parametrize("count", [1, 0, -3])
def test_fewer_than_two_parts_are_refused(tmp_path: Path, count: int) -> None:
    path = put(tmp_path, "a.ply", exported("ply"))
    for shape in (path, "part_01", "abc_0001"):
        with pytest.raises(InputError, match=f"num_parts={count}: give an integer, at least 2"):
            load(shape, num_parts=count)
