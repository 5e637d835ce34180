"""OBJ files as programs write them, and damaged ones."""

import io
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import trimesh
from mesh_files import BOX, OBJ

from jointsdf.errors import InputError
from jointsdf.geometry.topology import signed_volume
from jointsdf.shapes.readers.file_mesh import FileMesh
from jointsdf.shapes.readers.obj import read_obj

TETRA = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]


def read(text: str | bytes) -> FileMesh:
    return read_obj(Path("a.obj"), text.encode() if isinstance(text, str) else text)


def prism(first: int = 0) -> str:
    """An L extruded to height 2, with volume 6 and area 22, as two concave polygons from a corner on, and six quads."""
    flat = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
    lines = [f"v {x} {y} {z}" for z in (0, 2) for x, y in flat]
    ring = np.roll(np.arange(6), -first) + 1
    lines += ["f " + " ".join(map(str, each)) for each in (ring[::-1], ring + 6)]
    return "\n".join(lines + [f"f {a} {b} {b + 6} {a + 6}" for a, b in pairwise([1, 2, 3, 4, 5, 6, 1])]) + "\n"


SPELLINGS: dict[str, str | bytes] = {
    "plain": OBJ,
    "comments": "# a\n" + OBJ.replace("0 0 1\n", "0 0 1 # apex\n").replace("1 4 3", "1 4 3 # last"),
    "a comment that ends in a backslash": "# C:\\parts\\\n" + OBJ,
    "carriage returns": OBJ.replace("\n", "\r"),
    "both": OBJ.replace("\n", "\r\n"),
    "continued": OBJ.replace("f 1 3 2", "f 1 \\\n 3 \\\n2").replace("v 0 0 1", "v 0 \\\r\n0 1"),
    "relative": OBJ.replace("1 3 2", "-4 -2 -3").replace("1 4 3", "1 -1 3"),
    "textures and normals": "vt 0 0\nvn 0 0 1\n" + OBJ.replace("1 3 2", "1/1/1 3//1 2/1"),
    "spaces and tabs": OBJ.replace("v 1 0 0", "  v\t1   0\t0  ").replace("\n", " \n"),
    "utf-8 with mark": b"\xef\xbb\xbf" + OBJ.encode(),
    "utf-16": OBJ.encode("utf-16"),
    "utf-16 big": b"\xfe\xff" + OBJ.encode("utf-16-be"),
    "latin-1": "o Gehäuse\n".encode("latin-1") + OBJ.encode(),
    "weights": OBJ.replace("v 1 0 0", "v 1 0 0 1.0"),
    "exponents": OBJ.replace("v 1 0 0", "v 1.0E+00 0e0 -0.0"),
    "outlines": OBJ.replace("f ", "fo "),
    "faces first": "".join(OBJ.splitlines(keepends=True)[4:] + OBJ.splitlines(keepends=True)[:4]),
    "lines, points and short faces": OBJ + "l 1 2\np 1\nf 1 2\n",
    "other statements": OBJ + "s off\nmtllib a.mtl\nmg 1 0.5\nvp 0.1\n",
}


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_every_spelling_is_the_same_mesh(spelling: str) -> None:
    mesh = read(SPELLINGS[spelling])
    assert mesh.faces.tolist() == TETRA
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    assert (mesh.polygons, mesh.unit, mesh.sha256) == (None, None, "")


@pytest.mark.parametrize("first", range(6))
def test_polygons_have_the_volume_and_area_of_the_solid(first: int) -> None:
    mesh = read(prism(first))
    assert signed_volume(mesh.vertices, mesh.faces) == pytest.approx(6.0)
    assert trimesh.Trimesh(mesh.vertices, mesh.faces).area == pytest.approx(22.0)
    assert mesh.polygons is not None
    assert mesh.polygons.tolist() == [0] * 4 + [1] * 4 + sorted([*range(2, 8)] * 2)


def test_an_independent_reader_agrees() -> None:
    text = trimesh.creation.icosphere(2).export(file_type="obj", digits=17)
    other = trimesh.load_mesh(io.StringIO(text), file_type="obj", process=False)
    mesh = read(text)
    np.testing.assert_array_equal(mesh.vertices[mesh.faces], other.vertices[other.faces])


def test_columns_by_groups_objects_and_materials_of_polygons_and_triangles() -> None:
    head, *faces = prism().partition("f ")[0], *prism().splitlines()[12:]
    marks = ["g a  b\nusemtl steel#2", "o lid", "g c", "usemtl brass", "g a b", "f 1 2", "usemtl steel#2\ng", ""]
    mesh = read(head + "".join(f"{mark}\n{face}\n" for mark, face in zip(marks, faces, strict=True)))
    by_face = {
        "group": [0, 0, 1, 1, 0, 0, 2, 2],
        "object": [0, 1, 1, 1, 1, 1, 1, 1],
        "material": [0, 0, 0, 1, 1, 1, 0, 0],
    }
    assert mesh.polygons is not None
    assert set(mesh.columns) == set(by_face)
    for name, values in by_face.items():
        assert mesh.columns[name].values.tolist() == np.array(values)[mesh.polygons].tolist()
        assert not mesh.columns[name].are_ids
    assert read(OBJ).columns == {}


def test_colours_of_vertices_are_those_of_most_corners() -> None:
    red, blue = "1 0 0", "0 0 1"
    positions = ["0 0 0", "1 0 0", "0 1 0", "0 0 1"]
    text = "".join(f"v {at} {rgb}\n" for at, rgb in zip(positions, [red, red, blue, blue], strict=True))
    column = read(text + "f 3 4 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\n").columns["colour"]
    assert (column.values.tolist(), column.are_ids) == ([0, 1, 1, 0], False)
    partly = read(text.replace(f"v 0 1 0 {blue}", "v 0 1 0") + "f 1 3 2\nf 2 3 4\n").columns["colour"]
    assert partly.values.tolist() == [0, 0], "three different colours: the first corner's"


BAD: dict[str, tuple[str, str]] = {
    "decimal comma": (OBJ.replace("v 1 0 0", "v 1,5 0 0"), "line 2: '1,5' has a decimal comma"),
    "exponent after D": (OBJ.replace("v 1 0 0", "v 1.0D+00 0 0"), "line 2: '1.0D+00' has an exponent after D"),
    "no number": (OBJ.replace("v 1 0 0", "v 1 x0 0"), "line 2: 'x0' is no number"),
    "underscore": (OBJ.replace("v 1 0 0", "v 1_0 0 0"), "line 2: '1_0' is no number"),
    "two coordinates": (OBJ.replace("v 1 0 0", "v 1 0"), "line 2: 2 numbers where at least 3"),
    "a corner that is no integer": (OBJ.replace("f 1 2 4", "f 1 2.0 4"), "line 6: '2.0' is no number"),
    "a face of commas": (OBJ.replace("f 1 2 4", "f 1,2,4"), "line 6: '1,2,4' is no number"),
    "after a continued line": (OBJ.replace("0 0 1\n", "0 \\\n0 1\n").replace("f 1 2 4", "f 1 y 4"), "line 7: 'y'"),
    "after a comment": ("# a\\\n" + OBJ.replace("f 1 2 4", "f 1 y 4"), "line 7: 'y'"),
    "one corner": (OBJ.replace("f 1 2 4", "f 1"), "line 6: 1 numbers where at least 2"),
    "cut in a face": (OBJ[:-3], "line 8: the file ends within a face"),
    "cut in a vertex": (OBJ[:12], "line 2"),
    "vertex zero": (OBJ + "f 0 1 2\n", "line 9: vertex 0 is out of range 1..4"),
    "vertex too large": (OBJ + "f 1 2 5\n", "line 9: vertex 5 is out of range 1..4"),
    "vertex before the first": (OBJ + "f 1 2 -5\n", "line 9: vertex -5 is out of range"),
    "vertex beyond 64 bits": (OBJ + f"f 1 2 {10**30}\n", "line 9: '10000000000000000000' is no number"),
    "free form": ("v 0 0 0\nvp 0 0\ncstype bezier\nsurf 0 1 0 1 1\nend\n", "free-form surfaces (surf)"),
    "no OBJ": ("hello world\n", "has no faces, and 'hello' is no OBJ statement"),
}


@pytest.mark.parametrize("case", BAD)
def test_damage_is_one_line_that_names_file_and_line(case: str) -> None:
    text, message = BAD[case]
    with pytest.raises(InputError) as caught:
        read(text)
    assert message in str(caught.value)
    assert "a.obj" in str(caught.value)
    assert "\n" not in str(caught.value)


WARNINGS: dict[str, tuple[str, str]] = {
    "an open end": (OBJ.rstrip(), "its last line does not end in a line break"),
    "short faces, lines and points": (OBJ + "l 1 2\np 1\nf 1 2\n", "3 lines, points or faces of two corners"),
    "free form": (OBJ + "surf 0 1 0 1 1\n", "its free-form surfaces (surf) are left out"),
    "a flipped bit": (OBJ + "w 1 2 3\nx\n", "2 lines are no OBJ statements (first: 'w')"),
}


@pytest.mark.parametrize("case", WARNINGS)
def test_what_is_left_out_is_warned_of_once(case: str, caplog: pytest.LogCaptureFixture) -> None:
    text, message = WARNINGS[case]
    read(text)
    assert [message in record.message for record in caplog.records] == [True]


def test_without_faces_the_mesh_is_empty_but_for_its_vertices() -> None:
    mesh = read(OBJ[:32])
    assert (len(mesh.vertices), len(mesh.faces)) == (4, 0)


def test_no_cut_file_changes_what_comes_before_the_cut() -> None:
    data = BOX.export(file_type="obj")
    whole = read(data)
    for end in range(0, len(data), 7):
        try:
            mesh = read(data[:end])
        except InputError:
            continue
        assert whole.faces.tolist()[: len(mesh.faces)][:-1] == mesh.faces.tolist()[:-1]
