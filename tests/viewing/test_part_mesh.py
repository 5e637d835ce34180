"""Meshes written to files of every format, with their parts where the format holds them."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

import jointsdf
from jointsdf.shapes.readers.mesh_file import read_mesh
from jointsdf.values import ASSUMED_UNIT, Unit
from jointsdf.viewing.part_mesh import PartMesh

RING = trimesh.creation.annulus(r_min=3.0, r_max=4.0, height=2.0)


@pytest.mark.parametrize("kind", ["ply", "glb", "obj", "stl", "off"])
def test_a_mesh_is_exported(tmp_path, kind) -> None:
    mesh = PartMesh(RING.vertices, RING.faces, np.arange(len(RING.faces)) % 3)
    path = mesh.export(tmp_path / "new" / f"ring.{kind}")
    loaded = trimesh.load_scene(path).to_geometry()
    unit = 1e-3 if kind == "glb" else 1.0  # glTF is in metres
    assert loaded.area == pytest.approx(RING.area * unit**2, rel=1e-6)
    if kind == "ply":
        shape = jointsdf.load_shape(path, labels=str(path))
        assert shape.mesh.part_ids.tolist() == [0, 1, 2]


@pytest.mark.parametrize("kind", ["ply", "glb", "obj", "off"])
@pytest.mark.parametrize(
    ("scale", "offset", "unit", "up"),
    [
        (1e-6, 0.0, Unit("m", 1.0), "y"),
        (1.0, 4e6, ASSUMED_UNIT, "z"),
        (1 / 3, -4e6, Unit("in", 0.0254), "z"),
        (1e9, 1e15, Unit("0.3m", 0.3, known=False), "y"),
    ],
)
def test_a_mesh_comes_back_as_it_was_written(tmp_path, kind, scale, offset, unit, up) -> None:
    labels = np.arange(len(RING.faces)) * 7 % 4 - 1
    mesh = PartMesh(RING.vertices * scale + offset, RING.faces, labels, unit, up)
    found = read_mesh(mesh.export(tmp_path / f"ring.{kind}"))
    corners, bound = mesh.vertices[mesh.faces], 0.0
    if kind == "glb":  # part by part, in float32 about the middle
        corners, labels = corners[np.argsort(labels, kind="stable")], np.sort(labels)
        bound = 8 * scale * 2**-25 + 2 * np.spacing(np.abs(mesh.vertices).max())
    else:
        np.testing.assert_array_equal(found.faces, mesh.faces)
    np.testing.assert_allclose(found.vertices[found.faces], corners, rtol=0, atol=bound)
    if kind in ("ply", "glb"):
        assert (found.unit, found.up) == (unit, up)
        np.testing.assert_array_equal(found.columns["label"].values, labels)


@pytest.mark.parametrize("factor", [1.0, 1e-42, 1e40])
def test_stl_is_refused_where_it_would_round_the_part(tmp_path, factor) -> None:
    near, far = (PartMesh(RING.vertices + at, RING.faces, np.zeros(len(RING.faces), int)) for at in (100.0, 4e6))
    found = read_mesh(near.export(tmp_path / "ring.stl"))
    np.testing.assert_allclose(found.vertices[found.faces], near.vertices[near.faces], rtol=0, atol=2**-18)
    far = replace(far, vertices=far.vertices * factor)
    with pytest.raises(
        jointsdf.InputError, match=r"^[^\n]*ring.stl: stl has 7 digits for a mesh of 8\S* at 4\S* mm: use"
    ):
        far.export(tmp_path / "ring.stl")


def test_what_cannot_be_exported_is_one_line(tmp_path) -> None:
    mesh = PartMesh(RING.vertices, RING.faces, np.zeros(len(RING.faces), dtype=np.int64))
    with pytest.raises(jointsdf.InputError, match=r"^[^\n]*format step is not written; use ply, glb, obj, stl, off$"):
        mesh.export(tmp_path / "ring.step")
    empty = PartMesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64), np.zeros(0, dtype=np.int64))
    with pytest.raises(jointsdf.InputError, match="the mesh is empty"):
        empty.export(tmp_path / "ring.ply")
