"""PLY files as programs write them, whole, cut and damaged; plyfile reads the whole ones."""

import io
import tracemalloc
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import plyfile
import pytest
import trimesh
from damaged_files import read_flipped

from jointsdf.errors import InputError
from jointsdf.geometry.ply import binary_ply
from jointsdf.shapes.readers.file_mesh import FileMesh
from jointsdf.shapes.readers.ply import read_ply
from jointsdf.values import Unit

CODES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4",
    "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "float32": "f4", "float64": "f8", "int64": "i8",
}  # fmt: skip
FORMATS = {"": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}
L_OUTLINE = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 3), (0, 3)]  # area 4, perimeter 10, concave at (1, 1)
L_VERTICES = np.array([(x, y, z) for z in (0.0, 0.5) for x, y in L_OUTLINE])
L_SIDES = [[i, (i + 1) % 6, (i + 1) % 6 + 6, i + 6] for i in range(6)]
PRISM = [[5, 4, 3, 2, 1, 0], [6, 7, 8, 9, 10, 11], *L_SIDES[:5], [5, 0, 6], [5, 6, 11]]
TETRA = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])


@dataclass(frozen=True)
class Written:
    """A PLY file to be written: rows of elements, each property with its type."""

    order: str = ""
    vertices: np.ndarray = field(default_factory=lambda: CORNERS)
    faces: Sequence[Sequence[int]] = field(default_factory=lambda: TETRA)
    point: str = "double"
    index: str = "int"
    count: str = "uchar"
    name: str = "vertex_indices"
    newline: str = "\n"
    header: tuple[str, ...] = ()
    of_vertices: tuple[tuple[str, str, Sequence[float]], ...] = ()
    of_faces: tuple[tuple[str, str, Sequence[float]], ...] = ()
    before: bool = False  # the scalars of a face stand before its list
    list_of_faces: tuple[str, Sequence[Sequence[float]]] = ("", ())
    element: str = "face"

    def content(self) -> bytes:
        corners = f"property list {self.count} {self.index} {self.name}"
        scalars = [f"property {kind} {name}" for name, kind, _ in self.of_faces]
        more = [f"property list uchar float {self.list_of_faces[0]}"] if self.list_of_faces[0] else []
        lines = ["ply", f"format {FORMATS[self.order]} 1.0", *self.header, f"element vertex {len(self.vertices)}"]
        lines += [f"property {self.point} {axis}" for axis in "xyz"]
        lines += [f"property {kind} {name}" for name, kind, _ in self.of_vertices]
        lines += [f"element {self.element} {len(self.faces)}"]
        lines += ([*scalars, corners] if self.before else [corners, *scalars]) + more + ["end_header"]
        rows = [
            [*((self.point, x) for x in vertex), *((kind, values[i]) for _, kind, values in self.of_vertices)]
            for i, vertex in enumerate(self.vertices.tolist())
        ]
        for i, face in enumerate(self.faces):
            listed = [(self.count, len(face)), *((self.index, corner) for corner in face)]
            plain = [(kind, values[i]) for _, kind, values in self.of_faces]
            extra = self.list_of_faces[1][i] if more else None
            tail = [] if extra is None else [("uchar", len(extra)), *(("float", x) for x in extra)]
            rows.append((plain + listed if self.before else listed + plain) + tail)
        head = self.newline.join(lines) + self.newline
        if not self.order:
            return (head + "".join(" ".join(str(x) for _, x in row) + self.newline for row in rows)).encode("latin-1")
        body = (np.array(x, dtype=self.order + CODES[kind]).tobytes() for row in rows for kind, x in row)
        return head.encode("latin-1") + b"".join(body)


def read(written: Written | bytes) -> FileMesh:
    return read_ply(Path("a.ply"), written if isinstance(written, bytes) else written.content())


def refusal(data: Written | bytes) -> str:
    with pytest.raises(InputError) as caught:
        read(data)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("a.ply ")
    return str(caught.value)


def volume_and_area(mesh: FileMesh) -> tuple[float, float]:
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    doubled = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6), float(doubled.sum() / 2)


DIALECTS: dict[str, Written] = {
    "as usual": Written(),
    "list named vertex_index": Written(name="vertex_index"),
    "list of another name": Written(name="corners"),
    "unsigned": Written(index="uint", count="uint"),
    "bytes": Written(index="uint8", count="uint8"),
    "shorts": Written(index="ushort", count="short"),
    "new names": Written(point="float64", index="int32", count="uint8"),
    "floats": Written(point="float"),
    "normals and quality": Written(of_vertices=(("nx", "float", [0, 0, 1, 0]), ("quality", "double", [1, 2, 3, 4]))),
    "scalars before the list": Written(of_faces=(("label", "short", [4, 5, 6, 7]),), before=True),
    "texture list": Written(list_of_faces=("texcoord", [[0.5, 1.0], [], [0.25] * 6, [0, 0]])),
    "equal texture lists": Written(list_of_faces=("texcoord", [[0.5, 1.0]] * 4)),
    "comments": Written(header=("comment exporté par à", "obj_info num_cols 3", "comment element face 9", "comment")),
}  # fmt: skip


@pytest.mark.parametrize("order", FORMATS)
@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("dialect", DIALECTS)
def test_dialects_are_read(dialect: str, newline: str, order: str) -> None:
    mesh = read(replace(DIALECTS[dialect], order=order, newline=newline))
    assert mesh.vertices.tolist() == CORNERS.tolist()
    assert mesh.faces.tolist() == TETRA
    assert mesh.polygons is None


def test_a_first_byte_that_looks_like_a_line_break_is_data() -> None:
    vertices = CORNERS.copy()
    vertices[0, 0] = np.frombuffer(b"\n\0\0\0\0\0\xf0?")[
        0
    ]  # its first byte is LF, after a header whose lines end in CR
    mesh = read(Written("<", vertices, newline="\r"))
    assert mesh.vertices.tolist() == vertices.tolist()


@pytest.mark.parametrize("order", FORMATS)
@pytest.mark.parametrize("seed", range(4))
def test_plyfile_reads_the_same_from_polygons_of_any_size(order: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    vertices = rng.normal(size=(40, 3))
    faces = [rng.permutation(40)[: rng.integers(3, 3 + 3 * seed + 1)].tolist() for _ in range(60)]
    labels = rng.integers(-500, 500, 60).tolist()
    written = Written(order, vertices, faces, of_faces=(("label", "int", labels), ("weight", "double", labels)))
    theirs = plyfile.PlyData.read(io.BytesIO(written.content()))
    mesh = read(written)
    np.testing.assert_array_equal(mesh.vertices, np.stack([theirs["vertex"][axis] for axis in "xyz"], axis=1))
    owner = np.arange(60) if mesh.polygons is None else mesh.polygons
    for number, polygon in enumerate(theirs["face"]["vertex_indices"]):
        mine = mesh.faces[owner == number]
        assert len(mine) == len(polygon) - 2
        assert set(mine.ravel().tolist()) == set(polygon.tolist())
    np.testing.assert_array_equal(mesh.columns["label"].values, theirs["face"]["label"][owner])
    np.testing.assert_array_equal(mesh.columns["weight"].values, theirs["face"]["weight"][owner])


@pytest.mark.parametrize("order", FORMATS)
def test_polygons_of_a_prism_have_its_volume_and_area(order: str) -> None:
    mesh = read(Written(order, L_VERTICES, PRISM, of_faces=(("label", "int", list(range(9))),)))
    assert volume_and_area(mesh) == (pytest.approx(4 * 0.5), pytest.approx(2 * 4 + 10 * 0.5))
    assert mesh.polygons is not None
    assert mesh.polygons.tolist() == [*[0] * 4, *[1] * 4, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6, 7, 8]
    np.testing.assert_array_equal(mesh.columns["label"].values, mesh.polygons)


def test_faces_of_fewer_than_three_corners_count_as_no_face(caplog: pytest.LogCaptureFixture) -> None:
    written = Written(faces=[[0, 1], *TETRA, [3]], of_faces=(("label", "int", [9, 1, 2, 3, 4, 9]),))
    mesh = read(written)
    assert (mesh.faces.tolist(), mesh.columns["label"].values.tolist()) == (TETRA, [1, 2, 3, 4])
    assert "2 faces of fewer than three corners are left out" in caplog.text


@pytest.mark.parametrize("order", FORMATS)
def test_other_elements_are_left_out(order: str) -> None:
    data = Written(order).content()
    material = (
        b"element material 2\nproperty list uchar uchar name\nproperty float shine\nelement empty 3\nelement vertex"
    )
    row = b"3 1 2 3 0.5\n0 0.5\n" if not order else None
    shine = np.array(0.5, dtype=f"{order}f4").tobytes()
    row = row or b"\x03abc" + shine + b"\x00" + shine
    data = data.replace(b"element vertex", material).replace(b"end_header\n", b"end_header\n" + row)
    mesh = read(data)
    assert (mesh.vertices.tolist(), mesh.faces.tolist()) == (CORNERS.tolist(), TETRA)


@pytest.mark.parametrize("order", FORMATS)
def test_strips_alternate_and_end_at_minus_one(order: str) -> None:
    strips = [[0, 1, 2, 3, -1, 4, 5, 6], [], [0, 1], [7, 8, 9, 9, 10, 11, 12], [-1, 1, 2, 3, -1]]
    vertices = np.random.default_rng(0).normal(size=(13, 3))
    mesh = read(Written(order, vertices, strips, element="tristrips"))
    assert mesh.faces.tolist() == [
        [0, 1, 2], [2, 1, 3], [4, 5, 6], [7, 8, 9], [10, 9, 11], [10, 11, 12], [1, 2, 3]
    ]  # fmt: skip
    assert mesh.polygons is None


def test_trimeshs_own_files_are_read_with_their_attributes() -> None:
    mesh = trimesh.creation.icosphere(subdivisions=1)
    mesh.face_attributes["label"] = np.arange(80)  # as int64
    for encoding in ("binary", "ascii"):
        found = read(mesh.export(file_type="ply", encoding=encoding))
        assert found.faces.tolist() == mesh.faces.tolist()
        np.testing.assert_allclose(found.vertices, mesh.vertices, atol=1e-6)
        assert found.columns["label"].values.tolist() == list(range(80))


COLOURS = tuple((name, "uchar", values) for name, values in (
    ("red", [9, 9, 9, 9]), ("green", [7, 8, 7, 6]), ("blue", [0, 0, 0, 0]), ("alpha", [1, 2, 3, 4]),
))  # fmt: skip
COLUMNS: dict[str, tuple[Written, str, list[float], bool]] = {
    "label of faces": (Written(of_faces=(("label", "short", [7, -1, 0, 7]),)), "label", [7, -1, 0, 7], True),
    "double of faces": (Written(of_faces=(("q", "double", [0.1, 2.0, 0.1, 4.0]),)), "q", [0.1, 2.0, 0.1, 4.0], True),
    "colours of faces, without opacity": (Written(of_faces=COLOURS), "colour", [0, 1, 0, 2], False),
    "float colours": (
        Written(of_faces=tuple((n, "float", [v / 16 for v in values]) for n, _, values in COLOURS)),
        "colour", [0, 1, 0, 2], False,
    ),
    # faces 0 2 1, 0 1 3, 1 2 3, 0 3 2: a tie is the first corner's
    "label of vertices": (Written(of_vertices=(("id", "int", [5, 6, 6, 7]),)), "id", [6, 5, 6, 5], True),
    "colours of vertices": (Written(of_vertices=COLOURS), "colour", [0, 0, 1, 0], False),
    "faces before vertices": (
        Written(of_vertices=(("id", "int", [0, 0, 0, 0]),), of_faces=(("id", "int", [3, 4, 5, 6]),)),
        "id", [3, 4, 5, 6], True,
    ),
}  # fmt: skip


@pytest.mark.parametrize("order", FORMATS)
@pytest.mark.parametrize("case", COLUMNS)
def test_columns_of_triangles(case: str, order: str) -> None:
    written, name, expected, are_ids = COLUMNS[case]
    columns = read(replace(written, order=order)).columns
    assert list(columns) == [name]
    assert columns[name].values.tolist() == expected
    assert columns[name].are_ids == are_ids


def test_numbers_keep_their_type_and_their_bits() -> None:
    large = 2**62 + 1
    for order in FORMATS:
        [column] = read(Written(order, of_faces=(("label", "int64", [large, 0, 1, -1]),))).columns.values()
        assert (column.values.dtype, column.values.tolist()) == (np.int64, [large, 0, 1, -1])


@pytest.mark.parametrize(
    ("comment", "unit"),
    [
        ("unit mm 0.001", Unit("mm", 0.001)),
        ("unit in 2.54e-2", Unit("in", 0.0254)),
        ("unit mm 0.001 assumed", Unit("mm", 0.001, known=False)),
        ("unit of the world", None),
        ("unit mm 0", None),
        ("units mm 0.001", None),
    ],
)
def test_the_unit_is_in_a_comment(comment: str, unit: Unit | None) -> None:
    assert read(Written("<", header=("comment by hand", f"comment {comment}"))).unit == unit


def test_our_own_files_are_read_to_the_bit() -> None:
    rng = np.random.default_rng(1)
    vertices, faces, labels = rng.normal(size=(50, 3)), rng.integers(0, 50, (70, 3)), rng.integers(-1, 9, 70)
    mesh = read(binary_ply(vertices, faces, {"label": labels.astype("<i4")}, "unit mm 0.001"))
    np.testing.assert_array_equal(mesh.vertices, vertices)
    np.testing.assert_array_equal(mesh.faces, faces)
    np.testing.assert_array_equal(mesh.columns["label"].values, labels)


WHOLE: dict[str, Written] = {
    "triangles": Written(of_faces=(("label", "uchar", [1, 2, 3, 4]),)),
    "polygons": Written(vertices=L_VERTICES, faces=PRISM, of_faces=(("label", "int", list(range(9))),)),
}


@pytest.mark.parametrize("order", FORMATS)
@pytest.mark.parametrize("kind", WHOLE)
def test_no_cut_is_taken_for_whole(kind: str, order: str, caplog: pytest.LogCaptureFixture) -> None:
    data = replace(WHOLE[kind], order=order).content()
    whole = read(data)
    assert not caplog.records
    start = data.index(b"end_header\n") + len(b"end_header\n")
    lines = []
    for end in range(len(data) - 1):
        try:
            mesh = read(data[:end])
        except InputError as error:
            lines.append(str(error))
        else:  # the last number of a text may lack digits, which is said
            assert not order
            assert len(mesh.faces) == len(whole.faces)
            assert "no line break follows its last number" in caplog.text
    assert len(lines) > len(data) - 4
    assert all("is truncated: it declares" in line for line in lines[start:])


def test_a_cut_file_says_what_it_declares_and_holds() -> None:
    data = Written("<", L_VERTICES, PRISM).content()
    assert "declares 12 vertices and holds 11;" in refusal(data[: -(sum(1 + 4 * len(face) for face in PRISM) + 1)])
    assert "declares 9 faces and holds 7;" in refusal(data[:-14])
    data = Written("<").content()
    assert "declares 4 faces and holds 3;" in refusal(data[:-1])
    data = Written("").content()
    assert "declares 4 faces and holds 2;" in refusal(data[:-14])
    assert "declares 4 faces and holds 3;" in refusal(data[:-3])


BAD: dict[str, tuple[Callable[[], bytes], str]] = {
    "words": (lambda: b"hello", "cannot be read as ply"),
    "no end of the header": (lambda: Written().content()[:80], "has no end_header"),
    "no format": (lambda: Written().content().replace(b"format ascii 1.0\n", b""), "has no format"),
    "unknown format": (lambda: Written().content().replace(b"ascii", b"zip"), "its header has 'format zip 1.0'"),
    "unknown type": (lambda: Written(point="quad").content(), "its header has 'property quad x'"),
    "unknown word": (lambda: Written(header=("hello",)).content(), "its header has 'hello'"),
    "negative count": (lambda: Written().content().replace(b"face 4", b"face -4"), "its header has 'element face -4'"),
    "property twice": (lambda: Written(of_vertices=(("x", "int", [0] * 4),)).content(), "declares x twice"),
    "two tables of faces": (
        lambda: Written().content().replace(b"end_header", b"element face 0\nend_header"), "declares face twice"
    ),
    "points": (lambda: Written("<", faces=[]).content(), "is a point cloud: 4 points without faces; a mesh is needed"),
    "points alone": (
        lambda: b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
        b"property float scale_0\nend_header\n0 0 0 1\n", "is a point cloud: 1 points",
    ),
    "no z": (lambda: Written().content().replace(b"double z", b"double w"), "no vertices with x, y and z"),
    "corners in decimals": (lambda: Written("<", index="float").content(), "without a list vertex_indices of integers"),
    "a word for a number": (lambda: Written().content().replace(b"0.0 1.0 0.0", b"0.0 1,0 0.0"), "has '1,0' where"),
    "half a corner": (lambda: Written().content().replace(b"3 1 2 3", b"3 1 2 3.5"), "has '3.5' where a whole"),
    "a row too short": (lambda: Written().content().replace(b"3 0 1 3", b"3 0 1"), "row 1 of its 4 faces has too few"),
    "a row too long": (lambda: Written().content().replace(b"3 0 1 3", b"3 0 1 3 1"), "row 1 of its 4 faces has too"),
    "a label beyond its type": (
        lambda: Written(of_faces=(("label", "uchar", [1, 2, 300, 4]),)).content(), "its label is beyond 0..255"
    ),
    "rows after the last": (lambda: Written().content() + b"3 0 1 2\n", "1 lines follow its declared rows"),
    "bytes after the last": (lambda: Written("<").content() + b"\x03more", "5 bytes follow its declared rows"),
    "a negative length": (lambda: Written("<", count="char").content().replace(b"\x03", b"\xfd", 1), "negative length"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_a_bad_file_is_one_line(case: str) -> None:
    make, message = BAD[case]
    assert message in refusal(make())


@pytest.mark.parametrize("order", FORMATS)
@pytest.mark.parametrize("count", ["4000000000", "9" * 18, "9" * 40])
@pytest.mark.parametrize("element", ["vertex", "face"])
def test_no_memory_for_what_is_only_declared(element: str, count: str, order: str) -> None:
    data = Written(order).content().replace(f"{element} 4".encode(), f"{element} {count}".encode())
    tracemalloc.start()
    message = refusal(data)
    assert tracemalloc.get_traced_memory()[1] < 1 << 20
    tracemalloc.stop()
    assert count in message


@pytest.mark.parametrize("order", FORMATS)
@pytest.mark.parametrize("kind", WHOLE)
def test_any_flipped_bit_is_one_line_or_a_mesh_of_as_many_faces(kind: str, order: str) -> None:
    data = replace(WHOLE[kind], order=order, newline="\n").content()
    meshes, lines = read_flipped(read, data, 600)
    for mesh in meshes:
        assert mesh.faces.shape[1] == 3
        assert mesh.polygons is None or len(mesh.polygons) == len(mesh.faces)
    assert len(lines) > 60


@pytest.mark.parametrize(("point", "warns"), [("float", True), ("double", False)])
def test_single_precision_far_from_the_origin_is_said(
    point: str, warns: bool, caplog: pytest.LogCaptureFixture
) -> None:
    read(Written("<", CORNERS + 1e6, point=point))
    assert ("its 32-bit coordinates are rounded to 0.062 (6.2 % of the size)" in caplog.text) == warns
