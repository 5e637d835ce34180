"""Meshes written to files of every format, with their parts where the format holds them."""

import numpy as np
import pytest
import trimesh

import jointsdf
from jointsdf.viewing.part_mesh import PartMesh

RING = trimesh.creation.annulus(r_min=3.0, r_max=4.0, height=2.0)


@pytest.mark.parametrize("kind", ["ply", "glb", "obj", "stl", "off"])
def test_a_mesh_is_exported(tmp_path, kind) -> None:
    mesh = PartMesh(RING.vertices, RING.faces, np.arange(len(RING.faces)) % 3)
    path = mesh.export(tmp_path / "new" / f"ring.{kind}")
    loaded = trimesh.load_scene(path).to_geometry()
    assert loaded.area == pytest.approx(RING.area, rel=1e-6)
    if kind == "ply":
        shape = jointsdf.load_shape(path, labels=str(path))
        assert shape.mesh.part_ids.tolist() == [0, 1, 2]


def test_what_cannot_be_exported_is_one_line(tmp_path) -> None:
    mesh = PartMesh(RING.vertices, RING.faces, np.zeros(len(RING.faces), dtype=np.int64))
    with pytest.raises(jointsdf.InputError, match=r"^[^\n]*format step is not written; use ply, glb, obj, stl, off$"):
        mesh.export(tmp_path / "ring.step")
    empty = PartMesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64), np.zeros(0, dtype=np.int64))
    with pytest.raises(jointsdf.InputError, match="the mesh is empty"):
        empty.export(tmp_path / "ring.ply")
