"""OFF files as programs write them, whole, cut and damaged."""

import io
from pathlib import Path

import numpy as np
import pytest
import trimesh
from damaged_files import read_flipped
from mesh_files import OFF, TETRA_FACES, TETRA_VERTICES

from jointsdf.errors import InputError
from jointsdf.shapes.readers.file_mesh import FileMesh
from jointsdf.shapes.readers.off import read_off

CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
TETRA = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
BODY = "4 4 0\n" + TETRA_VERTICES + TETRA_FACES


def widened(numbers: str) -> str:
    return "".join(f"{line} {numbers}\n" for line in TETRA_VERTICES.splitlines())


def read(text: str | bytes) -> FileMesh:
    return read_off(Path("a.off"), text.encode() if isinstance(text, str) else text)


def refusal(text: str | bytes) -> str:
    with pytest.raises(InputError) as caught:
        read(text)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("a.off ")
    return str(caught.value)


WHOLE: dict[str, str | bytes] = {
    "as usual": OFF,
    "counts on the header's line": "OFF 4 4 6\n" + TETRA_VERTICES + TETRA_FACES,
    "counts on the header": "OFF" + BODY,
    "lower case": "off\n" + BODY,
    "no header": BODY,
    "two counts": "OFF\n4 4\n" + TETRA_VERTICES + TETRA_FACES,
    "comments": "# a comment\nOFF # here\n\n4 4 0 # counts\n" + TETRA_VERTICES + "# faces\n\n" + TETRA_FACES,
    "CRLF": OFF.replace("\n", "\r\n"),
    "CR": OFF.replace("\n", "\r"),
    "byte order mark": b"\xef\xbb\xbf" + OFF.encode(),
    "NUL padding": OFF.encode() + bytes(20),
    "NOFF": "NOFF\n4 4 0\n" + widened("0 0 1") + TETRA_FACES,
    "STOFF": "STOFF\n4 4 0\n" + widened("0.5 0.5") + TETRA_FACES,
}


@pytest.mark.parametrize("case", WHOLE)
def test_whole_files_are_read(case: str, caplog: pytest.LogCaptureFixture) -> None:
    mesh = read(WHOLE[case])
    assert (mesh.vertices.tolist(), mesh.faces.tolist(), mesh.polygons) == (CORNERS, TETRA, None)
    assert not mesh.columns
    assert not caplog.records


def test_trimesh_reads_the_same() -> None:
    data = trimesh.creation.icosphere(subdivisions=3).export(file_type="off").encode()
    theirs = trimesh.load_mesh(io.BytesIO(data), file_type="off", process=False)
    mesh = read(data)
    np.testing.assert_array_equal(mesh.vertices, theirs.vertices)
    np.testing.assert_array_equal(mesh.faces, theirs.faces)


def prism(sides: int, height: float) -> str:
    """A right prism over a regular polygon of radius 1, with polygons of `sides` and four corners."""
    angles = 2 * np.pi * np.arange(sides) / sides
    rows = [f"{np.cos(a)!r} {np.sin(a)!r} {z}" for z in (0.0, height) for a in angles.tolist()]
    rows = [row.replace("np.float64(", "").replace(")", "") for row in rows]
    faces = [list(range(sides))[::-1], list(range(sides, 2 * sides))]
    faces += [[i, (i + 1) % sides, (i + 1) % sides + sides, i + sides] for i in range(sides)]
    rows += [" ".join(map(str, [len(face), *face])) for face in faces]
    return f"OFF\n{2 * sides} {len(faces)} 0\n" + "\n".join(rows) + "\n"


@pytest.mark.parametrize("sides", [5, 6, 17])
def test_polygons_have_the_volume_and_area_of_a_prism(sides: int) -> None:
    mesh = read(prism(sides, 0.5))
    base, perimeter = sides / 2 * np.sin(2 * np.pi / sides), 2 * sides * np.sin(np.pi / sides)
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 == pytest.approx(base * 0.5)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    assert area == pytest.approx(2 * base + perimeter * 0.5)
    expected = np.repeat(np.arange(sides + 2), [sides - 2, sides - 2, *[2] * sides])
    np.testing.assert_array_equal(mesh.polygons, expected)


def with_colours(*colours: str) -> str:
    rows = zip(TETRA_FACES.splitlines(), colours, strict=True)
    return "OFF\n4 4 0\n" + TETRA_VERTICES + "".join(f"{face} {colour}\n" for face, colour in rows)


COLOURS: dict[str, tuple[str, list[int]]] = {
    "whole numbers": (with_colours("255 0 0", "0 255 0", "255 0 0", "0 0 255"), [0, 1, 0, 2]),
    "with opacity": (with_colours("255 0 0 9", "0 255 0 9", "255 0 0 3", "0 0 255 9"), [0, 1, 0, 2]),
    "decimals": (with_colours("0.5 0 0", "0.25 0 0", "0.5 0.0 0", "0.25 0 0 1"), [0, 1, 0, 1]),
    "indices of a map": (with_colours("7", "7", "3", "7"), [0, 0, 1, 0]),
    "some": (with_colours("", "0 0 0", "", "0 0 0"), [0, 1, 0, 1]),
    "of polygons": (
        "OFF\n5 5 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n4 3 2 1 0 9 9 9\n3 0 1 4 1 1 1\n3 1 2 4 9 9 9\n3 2 3 4\n"
        "3 3 0 4 1 1 1\n", [0, 0, 1, 0, 2, 1],
    ),
    "of vertices": ("COFF\n" + BODY.replace(TETRA_VERTICES, "0 0 0 9 9 9\n1 0 0 8 8 8\n0 1 0 9 9 9\n0 0 1 7 7 7\n"),
                    [0, 0, 1, 0]),
    "of vertices with normals": (
        "CNOFF\n" + BODY.replace(
            TETRA_VERTICES, "0 0 0 1 0 0 9 9 9 5\n1 0 0 0 1 0 8 8 8 4\n0 1 0 0 0 1 9 9 9 3\n0 0 1 1 0 0 7 7 7 2\n"
        ), [0, 0, 1, 0],
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", COLOURS)
def test_colours_are_a_column(case: str) -> None:
    text, expected = COLOURS[case]
    column = read(text).columns["colour"]
    assert (column.values.tolist(), column.are_ids) == (expected, False)


BAD: dict[str, tuple[str | bytes, str]] = {
    "words": ("hello\n", "cannot be read as off"),
    "noise": (bytes(range(256)), "cannot be read as off"),
    "header alone": ("OFF\n", "it has no counts"),
    "no counts": ("OFF\n4 four 0\n", "it has no counts"),
    "binary": (b"OFF BINARY\n\0\0\0\4\0\0\0\4\0\0\0\0", "is a binary OFF file"),
    "4OFF": ("4OFF\n" + BODY, "is 4OFF, of vertices in more than three dimensions"),
    "nOFF": ("nOFF\n5\n" + BODY, "is nOFF, of vertices in more than three dimensions"),
    "C4OFF": ("C4OFF\n" + BODY, "is C4OFF"),
    "cut in the vertices": (OFF[: OFF.index("0 1 0\n")], "declares 4 vertices and holds 2"),
    "cut in a vertex": (OFF[: OFF.index("0 0 1\n") + 3], "declares 4 vertices and holds 3"),
    "cut in the faces": (OFF[:-8], "truncated: it declares 4 faces and holds 3"),
    "cut in a face": (OFF[:-3], "truncated: it declares 4 faces and holds 3"),
    "many faces": (OFF.replace("4 4 0", "4 4000000000 0"), "declares 4000000000 faces and holds 4"),
    "many vertices": (OFF.replace("4 4 0", "4000000000 4 0"), "declares 4000000000 vertices and holds 8"),
    "colours in a plain OFF": (OFF.replace("1 0 0\n", "1 0 0 9 9 9\n"), "its vertex 1 has 6 numbers, not 3"),
    "a face too short": (OFF.replace("3 0 1 3", "3 0 1"), "its face 1 is '3 0 1'"),
    "a face too long": (OFF.replace("3 0 1 3", "3 0 1 3 1 1"), "its face 1 is '3 0 1 3 1 1'"),
    "a negative size": (OFF.replace("3 0 1 3", "-3 0 1 3"), "its face 1 is '-3 0 1 3'"),
    "comma": (OFF.replace("0 0 1\n", "0 0 1,5\n"), "has '1,5' where a number is needed"),
    "half a corner": (OFF.replace("3 0 1 3", "3 0 1 3.5"), "has '3.5' where a whole number is needed"),
    "lines after the last": (OFF + "3 0 1 2\n", "1 lines follow its declared faces"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_a_bad_file_is_one_line(case: str) -> None:
    text, message = BAD[case]
    assert message in refusal(text)


@pytest.mark.parametrize("text", [OFF, prism(6, 1.0), COLOURS["of vertices"][0]], ids=["plain", "polygons", "colours"])
def test_no_cut_is_taken_for_whole(text: str, caplog: pytest.LogCaptureFixture) -> None:
    whole = read(text)
    for end in range(len(text) - 1):
        try:
            mesh = read(text[:end])
        except InputError:
            continue
        assert len(mesh.faces) == len(whole.faces), "but for digits of the last number"
        assert "no line break follows its last number" in caplog.text


def test_any_flipped_bit_is_one_line_or_a_mesh() -> None:
    meshes, lines = read_flipped(read, OFF.encode(), 8 * len(OFF))
    assert all(len(mesh.faces) <= 4 for mesh in meshes)
    assert len(lines) > 60
