"""Columns of a mesh file's faces as labels."""

from pathlib import Path

import numpy as np
import pytest
from gltf_files import GltfFile
from mesh_files import AXES, BOX, COLOURS, OFF, SIDES, exported, load, painted, put
from step_files import NEEDS_READER, TOUCHING, step_boxes

from jointsdf.errors import InputError
from jointsdf.shapes.labels.columns import choose_column, read_own_labels, split_column, suggest_columns
from jointsdf.shapes.labels.providers import provide
from jointsdf.shapes.labels.unlabelled import UnlabelledShape
from jointsdf.shapes.readers.file_mesh import FaceColumn, FileMesh
from jointsdf.shapes.readers.triangles import read_triangles
from jointsdf.values import LabelledMesh

IDS, TWO, ONE = SIDES, SIDES % 2, np.zeros(12, dtype=int)


def mesh(**columns: np.ndarray) -> FileMesh:
    named = ("group", "material", "colour")
    found = {name: FaceColumn(values, are_ids=name not in named) for name, values in columns.items()}
    return FileMesh(np.array(BOX.vertices), np.array(BOX.faces), columns=found)


def test_a_column_follows_an_existing_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    put(tmp_path, "a.ply", "")
    put(tmp_path, "b:c.ply", "")
    put(tmp_path, "b", "")
    assert split_column("a.ply") == (Path("a.ply"), None)
    assert split_column("a.ply:colour") == (Path("a.ply"), "colour")
    assert split_column("a.ply:x:y") == (Path("a.ply"), "x:y")
    assert split_column("b:c.ply") == (Path("b:c.ply"), None)
    assert split_column("b:c.ply:label") == (Path("b:c.ply"), "label")
    assert split_column(f"{tmp_path}/a.ply:my label") == (tmp_path / "a.ply", "my label")
    for absent in ("c.ply", "c.ply:colour", ":colour", "a.ply:", "geometric"):
        assert split_column(absent) is None


@pytest.mark.parametrize(
    ("columns", "chosen"),
    [
        ({"label": ONE, "colour": IDS}, "label"),
        ({"colour": IDS, "group": TWO}, "colour"),
        ({"quality": TWO}, "quality"),
        ({"group": ONE, "material": IDS}, "material"),
    ],
)
def test_the_column_of_the_parts(columns: dict[str, np.ndarray], chosen: str) -> None:
    assert choose_column("it", mesh(**columns)) == chosen


def test_a_choice_or_none_is_refused_with_the_columns() -> None:
    with pytest.raises(InputError, match=r"it has no part labels.*one of group \(2 values\), material \(6 values\)"):
        choose_column("it", mesh(group=TWO, material=IDS, colour=ONE))
    with pytest.raises(InputError, match=r"it has no columns; give labels=<file.npy>"):
        choose_column("it", mesh())


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({"group": TWO}, "it: has 2 groups: labels=it:group takes them as parts"),
        ({"colour": IDS, "group": TWO}, "it: has 2 groups and 6 colours: labels=it:group takes"),
        ({"group": TWO, "material": IDS, "colour": TWO}, "has 2 groups, 6 materials and 2 colours: labels=it:group"),
        ({"segment": IDS}, "it: has 6 values of segment: labels=it:segment takes"),
        ({"group": ONE, "colour": IDS}, "it: has 6 colours: labels=it:colour takes"),
    ],
)
def test_columns_that_may_be_parts_are_suggested(columns: dict[str, np.ndarray], words: str) -> None:
    assert words in (suggest_columns("it", mesh(**columns)) or "")


def test_columns_that_are_hardly_parts_are_not_suggested() -> None:
    numbers = mesh(group=ONE, quality=np.linspace(0, 1, 12), face=IDS)
    assert suggest_columns("it", numbers) is None
    many = FileMesh(np.eye(3), np.tile([0, 1, 2], (65, 1)), columns={"colour": FaceColumn(np.arange(65), False)})
    assert suggest_columns("it", many) is None


def test_own_labels_of_a_file(tmp_path: Path) -> None:
    found = read_own_labels(put(tmp_path, "a.ply", painted()))
    assert found.labels.tolist() == SIDES.tolist()
    np.testing.assert_array_equal(found.vertices[found.faces], BOX.triangles)
    with pytest.raises(InputError, match=r"a.ply has no column 'label' of its faces: .*one of quality \(6 values\)"):
        read_own_labels(put(tmp_path, "a.ply", painted("quality")))
    with pytest.raises(InputError, match="holds -2: part ids"):
        read_own_labels(put(tmp_path, "a.ply", painted(values=SIDES - 2)))


def obj(polygons: str) -> str:
    lines = [f"v {x} {y} {z}" for x, y, z in BOX.vertices.tolist()]
    return "\n".join(lines) + "\n" + polygons


QUADS = obj(
    "g caps\nusemtl red\nf 2 4 3 1\nf 7 8 6 5\ng walls\nusemtl red\nf 5 6 2 1\nf 4 8 7 3\nusemtl blue\n"
    "f 3 7 5 1\nf 6 8 4 2\n"
)


def test_polygons_groups_and_materials_of_an_obj(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = put(tmp_path, "a.obj", QUADS)
    assert load(path).label_provider == "geometric:k=6"
    assert f"has 2 groups and 2 materials: labels={path}:group takes them" in caplog.text
    assert load(path, labels=f"{path}:group").mesh.labels.tolist() == [1] * 4 + [0] * 8
    assert load(path, labels=f"{path}:material").mesh.labels.tolist() == [0] * 8 + [1] * 4
    features = (
        "curves: []\nsurfaces:\n- {face_indices: [0, 1], type: Plane}\n- {face_indices: [2, 3, 4, 5], type: Plane}\n"
    )
    by_patch = load(path, labels=str(put(tmp_path, "a.yml", features)))
    assert by_patch.mesh.labels.tolist() == [0] * 4 + [1] * 8, "the patches are of the polygons"
    np.save(tmp_path / "labels.npy", [9, 8, 7, 6, 5, 4])
    assert load(path).mesh.labels.tolist() == np.repeat([9, 8, 7, 6, 5, 4], 2).tolist()
    np.save(tmp_path / "labels.npy", np.arange(12))
    assert load(path).mesh.labels.tolist() == list(range(12))
    np.save(tmp_path / "labels.npy", np.arange(7))
    with pytest.raises(InputError, match="has 7 labels, the mesh has 12 triangles, 6 polygons, 8 vertices"):
        load(path)


def test_colours_of_an_off_and_an_stl(tmp_path: Path) -> None:
    rows = [
        f"3 {a} {b} {c} {red} {green} {blue}" for (a, b, c), (red, green, blue) in zip(BOX.faces, COLOURS, strict=True)
    ]
    points = [f"{x} {y} {z}" for x, y, z in BOX.vertices.tolist()]
    path = put(tmp_path, "a.off", "\n".join(["OFF", "8 12 0", *points, *rows]) + "\n")
    assert load(path, labels=str(path)).mesh.labels.tolist() == AXES.tolist()
    plain = put(tmp_path, "b.off", OFF)
    with pytest.raises(InputError, match=r"b\.off has no part labels: neither a column label .*, nor colours"):
        load(plain, labels=str(plain))
    stl = exported("stl")
    words = 0x8000 | np.array([1, 2, 3])[AXES]
    data = bytearray(stl)
    for face, word in enumerate(words):
        data[84 + 50 * face + 48 : 84 + 50 * face + 50] = int(word).to_bytes(2, "little")
    path = put(tmp_path, "a.stl", bytes(data))
    assert load(path, labels=f"{path}:colour").mesh.labels.tolist() == AXES.tolist()


def test_nodes_of_a_foreign_glb_are_suggested(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    file = GltfFile()
    for name, axes in (("shaft", [2]), ("flange", [0, 1])):
        used = BOX.triangles[np.isin(AXES, axes)].reshape(-1, 3).astype(np.float32)
        file.node(name=name, mesh=file.mesh(file.primitive(used)))
    path = put(tmp_path, "a.glb", file.glb())
    assert load(path).label_provider.startswith("geometric")
    assert f"has 2 nodes: labels={path}:node takes them" in caplog.text
    assert load(path, labels=f"{path}:node").mesh.labels.tolist() == [1] * 4 + [0] * 8


@NEEDS_READER
def test_faces_bodies_and_colours_of_a_step_file(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = put(tmp_path, "a.step", step_boxes(TOUCHING, painted=2))
    found, patches = read_triangles(path)
    solid = LabelledMesh(found.vertices, found.faces[::-1], np.full(24, -1))
    shape = UnlabelledShape(str(path), found, solid, np.arange(24)[::-1], path=path, patches=patches)
    provide("auto", shape)
    assert "has 2 bodies and 2 colours" in caplog.text
    segments = put(tmp_path, "a.seg", "\n".join(map(str, range(40, 52))))
    for labels, expected in (
        (f"{path}:body", [1] * 12 + [0] * 12),
        (f"{path}:face", np.repeat(np.arange(12), 2)),
        (f"{path}:colour", np.isin(np.arange(24), [4, 5])),
        (str(segments), np.repeat(np.arange(40, 52), 2)),
    ):
        given, provider = provide(labels, shape)
        np.testing.assert_array_equal(given[::-1], expected)
        assert provider == f"file:{Path(labels).name}"
