"""Conversion of ABC files: units, components, merged vertices."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from abc_files import ABC, MESH, NAME, NEEDS_RAW, OBJ, RAW, box, filled, obj_text, outcomes, sides_of, yml_text
from step_files import METRE, NEEDS_READER, step_boxes

from jointsdf.abc_dataset import convert, prepare
from jointsdf.shapes import abc

ASSEMBLY = "00000050_80d90bfdd2e74e709956122a_step_000.step"  # abc_0008, abc_0009


@NEEDS_RAW
@pytest.mark.parametrize("name", ["abc_0015", "abc_0033"])
def test_a_distributed_obj_becomes_the_catalogues_own_mesh(tmp_path: Path, name: str) -> None:
    status, detail = outcomes(tmp_path, RAW, names=(name,))[name]
    assert (status, detail.split(": ")[-1]) == (prepare.DONE, "the catalogue's own mesh")
    for file in ("mesh.ply", "patches.npy"):
        assert (tmp_path / name / file).read_bytes() == (ABC / name / file).read_bytes()


@NEEDS_RAW
@NEEDS_READER
def test_a_distributed_step_file_becomes_the_catalogues_components(tmp_path: Path) -> None:
    names = ("abc_0008", "abc_0009")
    assert {each for each, _ in outcomes(tmp_path, RAW, names=names).values()} == {prepare.DONE}
    for name in names:
        made, own = (trimesh.load(root / name / "mesh.ply", process=False) for root in (tmp_path, ABC))
        assert made.is_watertight
        assert made.volume == pytest.approx(own.volume, rel=2e-3)
        assert np.allclose(made.bounds, own.bounds, atol=2e-3 * own.extents.max())
        patches, own_patches = (np.load(root / name / "patches.npy") for root in (tmp_path, ABC))
        areas = [np.sort(np.bincount(p, m.area_faces)) for p, m in ((patches, made), (own_patches, own))]
        assert np.allclose(*areas, rtol=5e-3)


@NEEDS_READER
@pytest.mark.parametrize("is_step", [False, True])
def test_a_component_is_known_by_its_size(tmp_path: Path, is_step: bool) -> None:
    entries = [abc.catalogue()[name] for name in ("abc_0009", "abc_0008")]
    sides = [np.array(entry.extents) / 1000 for entry in entries]
    corners = [((0, 0, 0), tuple(sides[0])), ((1, 0, 0), tuple(sides[1] + (1, 0, 0)))]
    bodies = [box(tuple(np.subtract(high, low)), low) for low, high in corners]
    mesh = trimesh.util.concatenate(bodies)
    patches = sides_of(mesh) + np.repeat([0, 6], 12)
    files = {
        ASSEMBLY.replace("_step_000.step", "_trimesh_000.obj"): obj_text(*bodies),
        ASSEMBLY.replace("_step_000.step", "_features_000.yml"): yml_text(patches),
    }
    if is_step:
        files = {ASSEMBLY: step_boxes(corners, METRE).encode()}
    found = outcomes(tmp_path, filled(tmp_path / "in", files), names=tuple(each.name for each in entries))
    assert {status for status, _ in found.values()} == {prepare.DONE}
    for entry in entries:
        mesh = trimesh.load(tmp_path / entry.name / "mesh.ply", process=False)
        assert np.allclose(mesh.extents, entry.extents, rtol=1e-5)
        assert len(mesh.faces) == 12
        assert np.bincount(np.load(tmp_path / entry.name / "patches.npy")).tolist() == [2] * 6


def test_where_no_component_fits_there_is_no_shape(tmp_path: Path) -> None:
    name = ASSEMBLY.replace("_step_000.step", "_trimesh_000.obj")
    found = outcomes(
        tmp_path,
        filled(tmp_path / "in", {name: obj_text(box((1, 2, 3)), box((1, 1, 1), (5, 5, 5)))}),
        names=("abc_0008",),
    )
    assert found["abc_0008"][0] == prepare.FAILED
    assert "none of its 2 components" in found["abc_0008"][1]
    assert not (tmp_path / "abc_0008").exists()


@pytest.mark.parametrize("factor", [1.0, 1000.0, 0.001, 25.4, 1 / 25.4, 10.0, 0.1, 0.0254, 304.8])
def test_units_are_found_from_the_extents(factor: float) -> None:
    entry = abc.catalogue()[NAME]
    uneven = np.array(entry.extents) * (1.004, 0.996, 1.0) / factor
    assert convert.find_scale(entry, np.array([[1.0, 2, 3], np.add(uneven, (1, 2, 3))])) == pytest.approx(
        factor, rel=1e-7
    )
    assert convert.find_scale(entry, np.array([[0.0, 0, 0], uneven * 1.5])) is None
    assert convert.find_scale(entry, np.array([[0.0, 0, 0], uneven * (1.03, 1, 1)])) is None


def test_a_mesh_in_no_unit_is_not_scaled_with_a_warning(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    files = {OBJ: obj_text(box((3.0, 4.0, 5.0)))}
    status, detail = outcomes(tmp_path, filled(tmp_path / "in", files))[NAME]
    assert status == prepare.DONE
    assert "no patches" in detail
    assert "has sides 3 4 5, the catalogue says 182.097 182.04 25.4" in caplog.text
    assert np.allclose(trimesh.load(tmp_path / NAME / "mesh.ply").extents, (3, 4, 5))
    assert not (tmp_path / NAME / "patches.npy").exists()


def test_a_normalised_mesh_takes_the_catalogues_size(tmp_path: Path) -> None:
    entry = abc.catalogue()["abc_0050"]
    files = {f"{entry.abc_id}.obj": obj_text(box(tuple(np.array(entry.extents) * 37.7)))}
    assert outcomes(tmp_path, filled(tmp_path / "in", files), names=("abc_0050",))["abc_0050"][0] == prepare.DONE
    assert np.allclose(trimesh.load(tmp_path / "abc_0050" / "mesh.ply").extents, entry.extents, rtol=1e-5)


def test_an_stl_file_is_merged(tmp_path: Path) -> None:
    files = {OBJ.replace(".obj", ".stl"): MESH.export(file_type="stl")}
    assert outcomes(tmp_path, filled(tmp_path / "in", files))[NAME][0] == prepare.DONE
    mesh = trimesh.load(tmp_path / NAME / "mesh.ply", process=False)
    assert (len(mesh.vertices), len(mesh.faces), mesh.is_watertight) == (8, 12, True)
    assert mesh.volume == pytest.approx(MESH.volume * 1e9, rel=1e-5)
