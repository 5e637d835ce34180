import hashlib
import logging
import os
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from jointsdf import shapes
from jointsdf.errors import InputError
from jointsdf.shapes import abc, repair
from jointsdf.shapes.labels import providers
from jointsdf.shapes.readers import mesh_file as file
from jointsdf.values import Shape
from jointsdf.viewing.export import write_mesh

BOX = trimesh.creation.box((2.0, 3.0, 4.0), transform=trimesh.transformations.translation_matrix((5, 6, 7)))
SIDES = np.unique(np.round(BOX.face_normals), axis=0, return_inverse=True)[1].ravel()
TETRA_VERTICES = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
TETRA_FACES = "3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n"
PLY_HEADER = (
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z\n"
    "element face 4\nproperty list uchar int vertex_indices\nend_header\n"
)
PLY = PLY_HEADER + TETRA_VERTICES + TETRA_FACES
OFF = "OFF\n4 4 0\n" + TETRA_VERTICES + TETRA_FACES
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
NEEDS_ABC = pytest.mark.skipif(not os.environ.get("JOINTSDF_ABC"), reason="JOINTSDF_ABC names no folder of ABC meshes")


def exported(kind: str) -> bytes:
    data = BOX.export(file_type=kind)
    return data.encode() if isinstance(data, str) else data


def load(shape: Path | str, **options: object) -> Shape:
    return shapes.load(str(shape), **{"abc_root": "nowhere", "segmented": False} | options)


def put(folder: Path, name: str, content: bytes | str) -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def signed_volume(shape: Shape) -> float:
    a, b, c = shape.mesh.vertices[shape.mesh.faces].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def nan_stl() -> bytes:
    data = bytearray(exported("stl"))
    data[96:100] = np.float32(np.nan).tobytes()
    return bytes(data)


BAD_MESHES: dict[str, tuple[str, bytes | str, str]] = {
    "empty ply": ("a.ply", "", "is empty"),
    "empty stl": ("a.stl", b"", "is empty"),
    "blank obj": ("a.obj", "\n\n", "is empty"),
    "unknown format": ("a.igs", "ISO-10303-21;", "use one of ply, obj, stl, off, glb"),
    "no format": ("a.", "x", "use one of ply"),
    "words, not a ply": ("a.ply", "hello", "cannot be read as ply"),
    "noise, not an stl": ("a.stl", bytes(range(256)) * 3, "cannot be read as stl"),
    "noise, not an off": ("a.off", bytes(range(256)), "cannot be read as off"),
    "noise, not a glb": ("a.glb", bytes(range(256)), "cannot be read as glb"),
    "words, not an obj": ("a.obj", "hello world\n", "no faces"),
    "ply cut in its header": ("a.ply", PLY[:80], "cannot be read as ply"),
    "ply cut in its vertices": ("a.ply", PLY[: len(PLY_HEADER) + 9], "cannot be read as ply"),
    "ply cut in its faces": ("a.ply", PLY[:-16], "truncated: it announces 4 faces and holds 2"),
    "binary ply cut": ("a.ply", exported("ply")[:-20], "cannot be read as ply"),
    "off cut": ("a.off", OFF[:-8], "truncated: it announces 4 faces and holds 3"),
    "binary stl cut": ("a.stl", exported("stl")[:-70], "cannot be read as stl"),
    "text stl cut": ("a.stl", exported("stl_ascii")[:900], "cannot be read as stl"),
    "glb cut": ("a.glb", exported("glb")[:-50], "cannot be read as glb"),
    "obj cut in a face": ("a.obj", OBJ[:-4], "cannot be read as obj"),
    "obj cut in a vertex": ("a.obj", OBJ[:12], "cannot be read as obj"),
    "ply without faces": ("a.ply", PLY_HEADER.replace("face 4", "face 0") + TETRA_VERTICES, "no faces"),
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
    "off index too large": ("a.off", OFF.replace("3 1 2 3", "3 1 2 9"), "cannot be read as off"),
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


def two_boxes() -> bytes:
    return trimesh.util.concatenate([trimesh.creation.box(), BOX]).export(file_type="ply")


def flipped(count: int) -> Callable[[], bytes]:
    def export() -> bytes:
        faces = BOX.faces.copy()
        faces[:count] = faces[:count, ::-1]
        return trimesh.Trimesh(BOX.vertices, faces, process=False).export(file_type="ply")

    return export


ODD_MESHES: dict[str, tuple[str, Callable[[], bytes | str], str, bool, float]] = {
    "clean": ("a.ply", lambda: exported("ply"), "", True, 24),
    "hole": ("a.obj", lambda: OBJ[: OBJ.rindex("f")], "not watertight (3 of 6 edges", False, 1 / 6),
    "components": ("a.ply", two_boxes, "2 separate components", True, 25),
    "inside out": ("a.ply", flipped(12), "inside out (negative volume): all faces flipped", True, 24),
    "few faces inside out": ("a.ply", flipped(2), "2 faces were inside out", True, 24),
    "most faces inside out": ("a.ply", flipped(9), "all faces flipped", True, 24),
    "degenerate": ("a.obj", lambda: OBJ + "f 1 1 2\nf 2 2 2\n", "2 degenerate faces", True, 1 / 6),
    "few faces": ("a.off", lambda: OFF, "very coarse (4 faces)", True, 1 / 6),
    "unused vertex": ("a.obj", lambda: OBJ + "v 100 100 100\n", "very coarse", True, 1 / 6),
}


@pytest.mark.parametrize("case", ODD_MESHES)
def test_odd_mesh_is_loaded_with_a_warning(tmp_path: Path, caplog: pytest.LogCaptureFixture, case: str) -> None:
    name, content, message, watertight, volume = ODD_MESHES[case]
    shape = load(put(tmp_path, name, content()))
    assert message in caplog.text
    assert bool(caplog.records) == bool(message)
    assert all(record.levelno == logging.WARNING and "\n" not in record.getMessage() for record in caplog.records)
    assert shape.watertight is watertight
    if case != "hole":
        assert signed_volume(shape) == pytest.approx(volume, rel=1e-6)
    assert len(np.unique(shape.mesh.faces)) == len(shape.mesh.vertices), "no vertex without a face"


def test_labels_of_degenerate_faces_go_with_them(tmp_path: Path) -> None:
    lines = OBJ.splitlines(keepends=True)
    path = put(tmp_path, "a.obj", "".join([*lines[:4], "f 1 1 2\n", *lines[4:6], "f 3 3 3\n", *lines[6:]]))
    np.save(tmp_path / "labels.npy", np.array([9, 5, 5, 8, 2, -1]))
    assert load(path).mesh.labels.tolist() == [5, 5, 2, -1]


def test_closed_mesh_that_touches_itself_stays_closed(tmp_path: Path) -> None:
    other = trimesh.creation.box(transform=trimesh.transformations.translation_matrix((1, 1, 0)))
    both = trimesh.util.concatenate([trimesh.creation.box(), other])
    shape = load(put(tmp_path, "a.off", both.export(file_type="off")))
    assert (shape.watertight, len(shape.mesh.vertices)) == (True, 16)


def test_one_sided_surface_is_not_taken_for_watertight(caplog: pytest.LogCaptureFixture) -> None:
    faces = np.array(  # the projective plane with 6 vertices: closed, and without an outside
        [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5], [0, 5, 1], [1, 2, 4], [2, 3, 5], [3, 4, 1], [4, 5, 2], [5, 1, 3]]
    )
    solid = repair.repair_mesh("it", np.random.default_rng(0).random((6, 3)), faces)
    assert not solid.watertight
    assert "one-sided" in caplog.text


def test_two_million_faces_warn(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    assert repair.SLOW == 2_000_000
    monkeypatch.setattr(repair, "SLOW", 12)
    repair.repair_mesh("it", np.array(BOX.vertices), np.array(BOX.faces))
    assert "it: 12 faces: distances and measures will be slow" in caplog.text


def test_polygons_are_read_but_refuse_labels(tmp_path: Path) -> None:
    quad = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nf 4 3 2 1\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n"
    path = put(tmp_path, "a.obj", quad)
    assert signed_volume(load(path)) == pytest.approx(1 / 3)
    np.save(tmp_path / "labels.npy", np.arange(6))
    with pytest.raises(InputError, match="triangulate it"):
        load(path)


@pytest.mark.parametrize(
    ("stem", "name"), [("my part (v2)", "my_part__v2_"), ("ä=1,b", "__1_b"), (".x", "x"), ("a.b-c_1", "a.b-c_1")]
)
def test_name_of_a_path_is_safe_for_a_folder(tmp_path: Path, stem: str, name: str) -> None:
    shape = load(put(tmp_path, f"{stem}.off", OFF))
    assert shape.name == f"{name}-{hashlib.sha256(OFF.encode()).hexdigest()[:6]}"


def test_providers_beside_a_mesh(tmp_path: Path) -> None:
    path = put(tmp_path, "a.ply", exported("ply"))
    with pytest.raises(InputError, match=r"no part labels: give labels=<file.npy>, or head=none"):
        load(path, labels="none", segmented=True)
    assert load(path).label_provider == load(path, labels="geometric").label_provider == "geometric:k=6"
    assert load(path, labels="brep").mesh.labels.tolist() == [-1] * 12
    with pytest.raises(InputError, match=r"patches.npy not found"):
        load(path, labels="brep", segmented=True)
    np.save(tmp_path / "patches.npy", np.arange(12) * 100)
    patches = load(path, labels="brep", segmented=True)
    assert (patches.label_provider, patches.mesh.labels.tolist()) == ("brep", (np.arange(12) * 100).tolist())
    np.save(tmp_path / "labels.npy", SIDES)
    assert load(path).label_provider == "file:labels.npy"
    assert load(path, labels="brep").label_provider == "brep"
    assert load(path, labels="none").label_provider == "none"
    np.save(tmp_path / "mine.npy", np.full(12, 4))
    with pytest.raises(InputError, match="only one part"):
        load(path, labels=str(tmp_path / "mine.npy"), segmented=True)
    assert load(path, labels=str(tmp_path / "mine.npy")).label_provider == "file:mine.npy"


def test_given_labels_are_never_merged(tmp_path: Path) -> None:
    sphere = trimesh.creation.icosphere(subdivisions=1)
    path = put(tmp_path, "a.ply", sphere.export(file_type="ply"))
    np.save(tmp_path / "patches.npy", np.arange(80))
    assert len(load(path, labels="brep", segmented=True).mesh.part_ids) == 80


@pytest.mark.parametrize(
    ("labels", "message"),
    [
        ("no/such.npy", "labels file not found: no/such.npy"),
        ("brp", "one of auto, geometric, partfield, brep, none"),
        ("x.npy", "not found"),
    ],
)
@pytest.mark.parametrize("shape", ["part_02", "file"])
def test_unknown_labels_are_named(tmp_path: Path, shape: str, labels: str, message: str) -> None:
    path = put(tmp_path, "a.ply", exported("ply"))
    with pytest.raises(InputError, match=message):
        load(path if shape == "file" else shape, labels=labels)


def test_built_in_takes_other_labels_by_file(tmp_path: Path) -> None:
    count = len(load("part_04").mesh.faces)
    np.save(tmp_path / "mine.npy", np.arange(count) % 2)
    assert load("part_04", labels=str(tmp_path / "mine.npy")).label_provider == "file:mine.npy"
    assert load("part_04", labels="none").mesh.part_ids.tolist() == []
    with pytest.raises(InputError, match="has its own labels"):
        load("part_04", labels="brep")
    split = load("part_04", labels="geometric", num_parts=5)
    assert (split.label_provider, split.mesh.part_ids.tolist()) == ("geometric:k=5", list(range(5)))
    assert len(load("part_04", labels="geometric").mesh.part_ids) >= 2


@pytest.mark.parametrize(
    ("typo", "near"), [("abc_001", "abc_0001"), ("part01", "part_01"), ("abc_013", "abc_0013"), ("xyz", "part_01")]
)
def test_typo_lists_near_names(typo: str, near: str) -> None:
    with pytest.raises(InputError, match=f"unknown shape '{typo}': near names are .*{near}"):
        load(typo)


def test_catalogue_lists_fifty_models() -> None:
    entries = abc.catalogue()
    assert list(entries) == [f"abc_{i:04d}" for i in range(1, 51)]
    assert len({entry.sha256 for entry in entries.values()}) == 50
    assert all(len(entry.sha256) == 64 and entry.abc_id and entry.source for entry in entries.values())
    patches = [entry.patches for entry in entries.values()]
    assert (patches.count(0), patches.count(1)) == (11, 2)


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


def test_the_benchmark_has_a_number_for_each_catalogue_shape() -> None:
    assert list(providers.benchmark()) == list(abc.catalogue())
    assert all(2 <= count <= 18 for count in providers.benchmark().values())


@pytest.mark.parametrize("count", [1, 0, -3])
def test_fewer_than_two_parts_are_refused(tmp_path: Path, count: int) -> None:
    path = put(tmp_path, "a.ply", exported("ply"))
    for shape in (path, "part_01", "abc_0001"):
        with pytest.raises(InputError, match=f"num_parts={count}: give an integer of at least 2"):
            load(shape, num_parts=count)


def test_more_parts_than_there_are_pieces_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"num_parts=1000000: this mesh can be cut into 1 to \d+ parts") as caught:
        load(put(tmp_path, "a.ply", exported("ply")), num_parts=10**6)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("labels", ["mine.npy", "auto", "brep", "none", "part_01"])
def test_a_number_of_parts_is_refused_where_there_is_no_choice(tmp_path: Path, labels: str) -> None:
    path: Path | str = put(tmp_path, "a.ply", exported("ply"))
    for name in ("labels.npy", "patches.npy", "mine.npy"):
        np.save(tmp_path / name, SIDES)
    if labels == "part_01":
        path, labels = "part_01", "auto"
    given = str(tmp_path / labels) if labels.endswith("npy") else labels
    with pytest.raises(InputError, match=r"num_parts=3: .*; leave num_parts out, or give labels=geometric"):
        load(path, labels=given, num_parts=3)


def test_repeated_faces_are_dropped_with_their_labels(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    lines = OBJ.splitlines(keepends=True)
    path = put(tmp_path, "a.obj", "".join([*lines, "f 3 2 1\n", lines[5], "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 5 7 6\n"]))
    np.save(tmp_path / "labels.npy", np.array([9, 5, 8, 2, 9, 1, 7]))
    shape = load(path)
    assert "3 repeated faces dropped with their labels" in caplog.text
    assert (shape.watertight, shape.mesh.labels.tolist()) == (True, [9, 5, 8, 2])
    assert signed_volume(shape) == pytest.approx(1 / 6)
    assert (shape.flipped, shape.dropped) == (0, 3)


def test_a_body_that_is_there_twice_is_kept_once(tmp_path: Path) -> None:
    twice = trimesh.util.concatenate([BOX, BOX])
    shape = load(put(tmp_path, "a.off", twice.export(file_type="off")))
    assert (shape.watertight, len(shape.mesh.faces), len(shape.mesh.vertices)) == (True, 12, 8)


def test_flipped_faces_are_counted(tmp_path: Path) -> None:
    assert load(put(tmp_path, "a.ply", flipped(3)())).flipped == 3
    assert load(put(tmp_path, "b.ply", flipped(12)())).flipped == 12
    assert load(put(tmp_path, "c.ply", exported("ply"))).flipped == 0


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


def test_non_manifold_edges_take_the_winding_number(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    fin = trimesh.Trimesh(
        [*BOX.vertices, [9.0, 9, 9]], [*BOX.faces, [BOX.faces[0][0], BOX.faces[0][1], 8]], process=False
    )
    shape = load(put(tmp_path, "a.ply", fin.export(file_type="ply")))
    assert not shape.watertight
    assert (
        "not watertight (3 of 20 edges do not have exactly two faces): the sign comes from the winding" in caplog.text
    )
    assert len(shape.mesh.part_ids) >= 2, "parts by geometry all the same"


def test_file_reader_leaves_the_file_as_it_is(tmp_path: Path) -> None:
    found = file.read(put(tmp_path, "a.stl", exported("stl")))
    assert (len(found.vertices), len(found.faces), found.has_polygons) == (36, 12, False)
