"""Mesh files of every format: whole, cut, damaged, and with labels."""

import gzip
import hashlib
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from mesh_files import BOX, OBJ, OFF, PLY, PLY_HEADER, SIDES, TETRA_VERTICES, exported, load, put, signed_volume
from step_files import NEEDS_READER, ONE, step_boxes

from jointsdf.errors import InputError
from jointsdf.shapes.readers import mesh_file
from jointsdf.viewing.export import write_mesh


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


def test_polygons_are_read_but_refuse_labels(tmp_path: Path) -> None:
    quad = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nf 4 3 2 1\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n"
    path = put(tmp_path, "a.obj", quad)
    assert signed_volume(load(path)) == pytest.approx(1 / 3)
    np.save(tmp_path / "labels.npy", np.arange(6))
    with pytest.raises(InputError, match="triangulate it"):
        load(path)


def painted(name: str = "label", values: np.ndarray | None = None, order: np.ndarray | None = None) -> str:
    """The box as a text PLY with one value per face: a property, or three colours."""
    order = np.arange(12) if order is None else order
    values = SIDES if values is None else values
    names = ("red", "green", "blue") if name == "colour" else (name,)
    rows = np.column_stack([np.full(12, 3), BOX.faces, values])[order]
    kind = "float" if values.dtype.kind == "f" else "int"
    header = ["ply", "format ascii 1.0", "element vertex 8", *(f"property double {axis}" for axis in "xyz")]
    header += ["element face 12", "property list uchar int vertex_indices"]
    header += [f"property {'uchar' if name == 'colour' else kind} {column}" for column in names] + ["end_header"]
    number = (lambda x: f"{x:.3f}") if kind == "float" else (lambda x: str(int(x)))
    lines = [" ".join(map(repr, map(float, vertex))) for vertex in BOX.vertices]
    lines += [" ".join([*(str(int(x)) for x in row[:4]), *map(number, row[4:])]) for row in rows]
    return "\n".join([*header, *lines]) + "\n"


def test_a_ply_holds_labels_for_its_faces(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = put(tmp_path, "a.stl", exported("stl"))
    given = put(tmp_path, "b.ply", painted(values=SIDES * 100 - 1))
    assert load(path, labels=str(given)).mesh.labels.tolist() == (SIDES * 100 - 1).tolist()
    assert "another order" not in caplog.text
    order = np.random.default_rng(0).permutation(12)
    given.write_text(painted(values=SIDES * 100 - 1, order=order))
    shape = load(path, labels=str(given))
    assert (shape.label_provider, shape.mesh.labels.tolist()) == ("file:b.ply", (SIDES * 100 - 1).tolist())
    assert "its faces are in another order" in caplog.text


@pytest.mark.parametrize("exporter", ["text", "binary"])
def test_face_colours_are_parts_by_falling_area(tmp_path: Path, exporter: str) -> None:
    path = put(tmp_path, "a.ply", exported("ply"))
    axes = np.abs(BOX.face_normals).argmax(axis=1)  # areas of the two sides along each axis: 24, 16, 12
    colours = np.array([[9, 9, 200], [255, 0, 1], [255, 0, 0]], dtype=np.uint8)[axes]
    if exporter == "text":
        content: bytes | str = painted("colour", colours)
    else:
        coloured = trimesh.Trimesh(BOX.vertices, BOX.faces[::-1], process=False, face_colors=colours[::-1])
        content = coloured.export(file_type="ply")
    shape = load(path, labels=str(put(tmp_path, "b.ply", content)), segmented=True)
    np.testing.assert_array_equal(shape.mesh.labels, axes)


def test_our_own_painted_mesh_gives_its_labels_back(tmp_path: Path) -> None:
    shape = load("part_07")
    write_mesh(tmp_path, replace(shape.mesh, labels=shape.mesh.labels * 3 + 30))
    again = load(tmp_path / "mesh.ply", labels=str(tmp_path / "mesh.ply"))
    np.testing.assert_array_equal(again.mesh.labels, shape.mesh.labels * 3 + 30)


BAD_PLY_LABELS: dict[str, tuple[bytes | str, str]] = {
    "no colours": (exported("ply"), "has no part labels: it needs an integer face property label, or face colours"),
    "floats": (painted(values=SIDES + 0.5), "must be an integer >= -1"),
    "below -1": (painted(values=SIDES - 2), "must be an integer >= -1"),
    "two faces fewer": (
        painted().replace("element face 12", "element face 10").rsplit("\n", 3)[0] + "\n",
        "has 10 faces, the mesh has 12: it is of another mesh",
    ),
    "another mesh": (painted().replace("6.0", "7.5"), "is of another mesh: of its 12 faces and the mesh's 12"),
    "cut": (painted()[:-30], "truncated"),
}


@pytest.mark.parametrize("case", BAD_PLY_LABELS)
def test_bad_labels_in_a_ply_are_one_line_that_names_it(tmp_path: Path, case: str) -> None:
    content, message = BAD_PLY_LABELS[case]
    path, given = put(tmp_path, "a.ply", exported("ply")), put(tmp_path, "b.ply", content)
    with pytest.raises(InputError) as caught:
        load(path, labels=str(given))
    assert message in str(caught.value)
    assert str(given) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_file_reader_leaves_the_file_as_it_is(tmp_path: Path) -> None:
    found = mesh_file.read_mesh(put(tmp_path, "a.stl", exported("stl")))
    assert (len(found.vertices), len(found.faces), found.has_polygons) == (36, 12, False)
