"""Mesh files of every format: whole, cut, damaged, and with labels."""

import gzip
import hashlib
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import trimesh
from mesh_files import BOX, OBJ, OFF, PLY, PLY_HEADER, SIDES, TETRA_VERTICES, exported, load, put, signed_volume
from step_files import NEEDS_READER, ONE, step_boxes

from jointsdf.errors import InputError
from jointsdf.shapes.readers import mesh_file


def nan_stl() -> bytes:
    data = bytearray(exported("stl"))
    data[96:100] = np.float32(np.nan).tobytes()
    return bytes(data)


BAD_MESHES: dict[str, tuple[str, bytes | str, str]] = {
    "empty ply": ("a.ply", "", "is empty"),
    "empty stl": ("a.stl", b"", "is empty"),
    "blank obj": ("a.obj", "\n\n", "is empty"),
    "unknown format": ("a.what", "x", "use one of ply, obj, stl, off, glb"),
    "another format": ("a.igs", "ISO-10303-21;", "holds STEP, which its name does not say: rename it to a.step"),
    "no format": ("a.", "x", "use one of ply"),
    "words, not a ply": ("a.ply", "hello", "cannot be read as ply"),
    "noise, not an stl": ("a.stl", bytes(range(256)) * 3, "cannot be read as stl"),
    "noise, not an off": ("a.off", bytes(range(256)), "cannot be read as off"),
    "noise, not a glb": ("a.glb", bytes(range(256)), "cannot be read as glb"),
    "words, not an obj": ("a.obj", "hello world\n", "no faces"),
    "ply cut in its header": ("a.ply", PLY[:80], "cannot be read as ply"),
    "ply cut in its vertices": ("a.ply", PLY[: len(PLY_HEADER) + 9], "declares 4 vertices and holds 1"),
    "ply cut in its faces": ("a.ply", PLY[:-16], "truncated: it declares 4 faces and holds 2"),
    "binary ply cut": ("a.ply", exported("ply")[:-20], "truncated: it declares 12 faces and holds 10"),
    "off cut": ("a.off", OFF[:-8], "truncated: it declares 4 faces and holds 3"),
    "binary stl cut": ("a.stl", exported("stl")[:-70], "it declares 12 faces and holds 10"),
    "text stl cut": ("a.stl", exported("stl_ascii")[:900], "truncated: it begins 9 facets and ends 8"),
    "glb cut": ("a.glb", exported("glb")[:-50], "cannot be read as glb"),
    "obj cut in a face": ("a.obj", OBJ[:-4], "cannot be read as obj"),
    "obj cut in a vertex": ("a.obj", OBJ[:12], "cannot be read as obj"),
    "ply without faces": ("a.ply", PLY_HEADER.replace("face 4", "face 0") + TETRA_VERTICES, "4 points without faces"),
    "off without faces": ("a.off", "OFF\n4 0 0\n" + TETRA_VERTICES, "no faces"),
    "obj without faces": ("a.obj", OBJ[:32], "no faces"),
    "nan in ply": ("a.ply", PLY.replace("0 0 1\n", "0 nan 1\n"), "NaN or infinite coordinates in 1 vertices"),
    "inf in ply": ("a.ply", PLY.replace("0 0 1\n", "0 0 inf\n"), "NaN or infinite"),
    "nan in obj": ("a.obj", OBJ.replace("v 0 0 1", "v 0 0 NaN"), "NaN or infinite"),
    "nan in an unused vertex": ("a.obj", OBJ + "v nan 0 0\n", "NaN or infinite"),
    "inf in obj": ("a.obj", OBJ.replace("v 0 0 1", "v 0 0 -Inf"), "NaN or infinite"),
    "absurd number": ("a.obj", OBJ.replace("v 0 0 1", "v 0 0 -1e200"), "has a coordinate of 1e+200, beyond 1e+30"),
    "nan in off": ("a.off", OFF.replace("0 0 1\n", "0 0 nan\n"), "NaN or infinite"),
    "nan in stl": ("a.stl", nan_stl(), "NaN or infinite"),
    "ply index too large": ("a.ply", PLY.replace("3 1 2 3", "3 1 2 9"), "out of range 0..3"),
    "ply index negative": ("a.ply", PLY.replace("3 1 2 3", "3 1 2 -1"), "out of range"),
    "obj index too large": ("a.obj", OBJ + "f 1 2 9\n", "out of range"),
    "obj index zero": ("a.obj", OBJ + "f 0 1 2\n", "out of range"),
    "off index too large": ("a.off", OFF.replace("3 1 2 3", "3 1 2 9"), "out of range 0..3"),
    "flat": ("a.ply", PLY.replace("0 0 1\n", "1 1 0\n"), "is flat: its extents are [1.0, 1.0, 0.0]"),
    "only degenerate faces": (
        "a.obj", OBJ[:32] + "v .5 .5 .5\nv 1 1 1\nf 1 1 2\nf 1 5 6\nf 3 4 4\n", "all 3 are degenerate"
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD_MESHES)
def test_bad_mesh_is_one_line_that_names_the_file(tmp_path: Path, case: str) -> None:
    name, content, message = BAD_MESHES[case]
    path = put(tmp_path, name, content)
    with pytest.raises(InputError) as caught:
        load(path)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", ["ply", "obj", "stl", "stl_ascii", "off", "glb"])
def test_no_cut_file_is_taken_for_whole(tmp_path: Path, kind: str) -> None:
    data = exported(kind)
    path = put(tmp_path, f"a.{kind.partition('_')[0]}", data)
    whole = load(path).mesh
    for end in np.linspace(0, len(data.rstrip()) - 1, 60).astype(int):
        path.write_bytes(data[:end])
        with suppress(InputError):
            assert kind == "obj" or len(load(path).mesh.faces) == len(whole.faces), (
                "only an OBJ does not tell its length"
            )


@pytest.mark.parametrize("kind", ["ply", "obj", "stl", "stl_ascii", "off", "glb"])
def test_a_compressed_file_is_the_same_mesh_under_its_own_hash(tmp_path: Path, kind: str) -> None:
    suffix = kind.partition("_")[0]
    whole = load(put(tmp_path, f"part.{suffix}", exported(kind)))
    path = put(tmp_path, f"part.{suffix}.GZ", gzip.compress(exported(kind)))
    shape = load(path)
    np.testing.assert_array_equal(shape.mesh.vertices, whole.mesh.vertices)
    np.testing.assert_array_equal(shape.mesh.faces, whole.mesh.faces)
    assert shape.mesh_sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert shape.name == f"part-{shape.mesh_sha256[:6]}"


@NEEDS_READER
@pytest.mark.parametrize("name", ["a.p21", "a.STP", "a.step.gz", "a.stp.GZ", "a.P21.gz"])
def test_step_under_any_of_its_names(tmp_path: Path, name: str) -> None:
    data = step_boxes(ONE).encode()
    shape = load(put(tmp_path, name, gzip.compress(data) if name.lower().endswith("gz") else data), labels="brep")
    assert signed_volume(shape) == pytest.approx(6)
    assert shape.mesh.part_ids.tolist() == list(range(6))
    with pytest.raises(InputError, match="is no mesh but a STEP file: give one of ply, obj"):
        mesh_file.read_mesh(tmp_path / name)


def test_missing_paths_and_folders(tmp_path: Path) -> None:
    for missing in ("no_such.ply", str(tmp_path / "no_such"), "abc_0001.stl"):
        with pytest.raises(InputError, match="file not found") as caught:
            load(missing)
        assert missing in str(caught.value)
    with pytest.raises(InputError, match="is a folder"):
        load(tmp_path)


@pytest.mark.parametrize("kind", ["ply", "obj", "stl", "stl_ascii", "off", "glb"])
def test_every_format_keeps_the_order_of_faces(tmp_path: Path, kind: str) -> None:
    path = put(tmp_path, f"a.{kind.partition('_')[0]}", exported(kind))
    np.save(tmp_path / "labels.npy", SIDES * 10 + 3)
    shape = load(path, segmented=True)
    np.testing.assert_allclose(shape.mesh.vertices[shape.mesh.faces], BOX.triangles, atol=1e-6)
    np.testing.assert_array_equal(shape.mesh.labels, SIDES * 10 + 3)
    assert len(shape.mesh.vertices) == 8
    assert shape.watertight
    assert shape.label_provider == "file:labels.npy"
    assert shape.mesh_sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert shape.name == f"a-{shape.mesh_sha256[:6]}"


def test_obj_with_materials_groups_and_texture_keeps_the_order_of_faces(tmp_path: Path) -> None:
    vertices = "".join(f"v {x} {y} {z}\n" for x, y, z in BOX.vertices)
    corner = ("{0}/1/1", "{0}", "{0}//1", "{0}/1")
    lines = []
    for i, face in enumerate(BOX.faces):
        spelt = " ".join(corner[i % 4].format(v + 1 if i % 2 else v - 8) for v in face)
        lines.append(f"usemtl m{i % 3}\ng g{i % 2}\nf {spelt}\n")
    path = put(tmp_path, "a.obj", "mtllib no.mtl\nvt 0 0\nvn 0 0 1\n" + vertices + "".join(lines))
    np.testing.assert_allclose(load(path).mesh.vertices[load(path).mesh.faces], BOX.triangles)


def test_glb_of_many_meshes_is_joined_in_its_order_and_place(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    for i in range(12):
        move = trimesh.transformations.translation_matrix([3.0 * i, 0, 0])
        scene.add_geometry(trimesh.creation.box(), geom_name=f"g{i}", transform=move)
    shape = load(put(tmp_path, "a.glb", scene.export(file_type="glb")))
    centres = shape.mesh.vertices[shape.mesh.faces].mean(axis=1).reshape(12, 12, 3).mean(axis=1)
    np.testing.assert_allclose(centres, [[3.0 * i, 0, 0] for i in range(12)], atol=1e-6)


def test_file_reader_leaves_the_file_as_it_is(tmp_path: Path) -> None:
    found = mesh_file.read_mesh(put(tmp_path, "a.stl", exported("stl")))
    assert (len(found.vertices), len(found.faces), found.has_polygons) == (36, 12, False)
