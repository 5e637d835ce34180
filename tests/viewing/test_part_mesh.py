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
    unit = 1e-3 if kind == "glb" else 1.0  # glTF is in metres
    assert loaded.area == pytest.approx(RING.area * unit**2, rel=1e-6)
    if kind == "ply":
        shape = jointsdf.load_shape(path, labels=str(path))
        assert shape.mesh.part_ids.tolist() == [0, 1, 2]


@pytest.mark.parametrize("kind", ["ply", "obj", "off"])
@pytest.mark.parametrize(("scale", "offset"), [(1e-6, 0.0), (1.0, 4e6), (1 / 3, -4e6), (1e9, 1e15)])
def test_coordinates_keep_all_their_digits(tmp_path, kind, scale, offset) -> None:
    mesh = PartMesh(RING.vertices * scale + offset, RING.faces, np.zeros(len(RING.faces), dtype=np.int64))
    content = mesh.export(tmp_path / f"ring.{kind}").read_text(errors="replace")
    if kind == "ply":
        read = trimesh.load_mesh(tmp_path / "ring.ply", process=False).vertices
    else:
        rows = [line.removeprefix("v ").split() for line in content.splitlines()]
        read = np.array(rows[2 * (kind == "off") :][: len(mesh.vertices)], dtype=float)
    np.testing.assert_array_equal(read, mesh.vertices)


def test_stl_is_refused_where_it_would_round_the_part(tmp_path) -> None:
    near, far = (PartMesh(RING.vertices + at, RING.faces, np.zeros(len(RING.faces), int)) for at in (100.0, 4e6))
    near.export(tmp_path / "ring.stl")
    message = r"^[^\n]*ring.stl: stl has 7 digits for a mesh of 8 at 4e\+06 mm: use ply or obj$"
    with pytest.raises(jointsdf.InputError, match=message):
        far.export(tmp_path / "ring.stl")


def test_what_cannot_be_exported_is_one_line(tmp_path) -> None:
    mesh = PartMesh(RING.vertices, RING.faces, np.zeros(len(RING.faces), dtype=np.int64))
    with pytest.raises(jointsdf.InputError, match=r"^[^\n]*format step is not written; use ply, glb, obj, stl, off$"):
        mesh.export(tmp_path / "ring.step")
    empty = PartMesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64), np.zeros(0, dtype=np.int64))
    with pytest.raises(jointsdf.InputError, match="the mesh is empty"):
        empty.export(tmp_path / "ring.ply")
