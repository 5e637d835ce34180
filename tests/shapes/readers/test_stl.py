"""STL files as programs write them, whole, cut and damaged; trimesh writes them and reads the whole ones."""

import io
import re
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from damaged_files import read_flipped
from mesh_files import BOX, exported

from jointsdf.errors import InputError
from jointsdf.shapes.readers.file_mesh import FileMesh
from jointsdf.shapes.readers.stl import read_stl

BINARY = exported("stl")
TEXT = exported("stl_ascii")
FACETS = TEXT.split(b"\n", 1)[1].rpartition(b"endsolid")[0]
SHIFTED = re.sub(rb"vertex (\S+)", lambda found: b"vertex %g" % (float(found[1]) + 10), FACETS)


def read(data: bytes) -> FileMesh:
    return read_stl(Path("a.stl"), data)


def refusal(data: bytes) -> str:
    with pytest.raises(InputError) as caught:
        read(data)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("a.stl ")
    return str(caught.value)


def is_box(mesh: FileMesh) -> bool:
    return mesh.faces.shape == (12, 3) and np.allclose(mesh.vertices[mesh.faces], BOX.triangles, atol=1e-6)


def solid(name: bytes, facets: bytes = FACETS, end: bytes = b"endsolid") -> bytes:
    return b"solid" + name + b"\n" + facets + end + name + b"\n"


WHOLE: dict[str, tuple[bytes, str]] = {
    "binary": (BINARY, ""),
    "binary, header begins with solid": (b"solid part".ljust(80) + BINARY[80:], ""),
    "binary, header is a text STL's": (b"solid a\n facet normal 0 0 1\n".ljust(80) + BINARY[80:], ""),
    "binary, bytes after it": (BINARY + b"\r\n", "2 bytes after its 12 faces are left out"),
    "binary with a solid header, bytes after it": (b"solid part".ljust(80) + BINARY[80:] + b"end", "3 bytes after"),
    "binary, unknown count 0": (BINARY[:80] + struct.pack("<I", 0) + BINARY[84:], "declares 0 faces, and holds 12"),
    "binary, unknown count -1": (
        BINARY[:80] + struct.pack("<i", -1) + BINARY[84:], "declares 4294967295 faces, and holds 12"
    ),
    "text": (TEXT, ""),
    "CRLF": (TEXT.replace(b"\n", b"\r\n"), ""),
    "CR": (TEXT.replace(b"\n", b"\r"), ""),
    "upper case": (TEXT.upper(), ""),
    "indented, blank lines": (TEXT.replace(b"\n", b"\n\n \t "), ""),
    "end solid": (solid(b" part", end=b"end solid"), ""),
    "end loop, end facet": (TEXT.replace(b"endloop", b"end loop").replace(b"endfacet", b"end facet"), ""),
    "byte order mark": (b"\xef\xbb\xbf" + TEXT, ""),
    "blank first": (b"\r\n  " + TEXT, ""),
    "text after it": (TEXT + b"exported by a program\nof vertices and a solid name\n", ""),
    "NUL padding": (TEXT + bytes(512), ""),
    "NUL in the name's line": (solid(b" part" + bytes(40)), ""),
    "control-Z": (TEXT + b"\x1a", ""),
    "no name": (solid(b""), ""),
    "name of a keyword": (solid(b" vertex_cap"), ""),
    "name of keywords": (solid(b" facet normal holder"), ""),
    "name of an end": (solid(b" endsolid solid"), ""),
    "Latin-1 name": (solid(b" Geh\xe4use"), ""),
    "long name": (solid(b" " + 300 * b"x"), ""),
    "normals that are none": (re.sub(rb"normal [^\n]*", b"normal -nan(ind) nan 0", TEXT), ""),
    "no end line": (TEXT.rpartition(b"endsolid")[0], "no endsolid follows its 12 facets"),
}  # fmt: skip


@pytest.mark.parametrize("case", WHOLE)
def test_whole_files_are_read(case: str, caplog: pytest.LogCaptureFixture) -> None:
    data, warning = WHOLE[case]
    mesh = read(data)
    assert is_box(mesh)
    assert not mesh.columns
    assert [warning in record.getMessage() for record in caplog.records] == [True] * bool(warning)


def test_trimesh_reads_the_same() -> None:
    sphere = trimesh.creation.icosphere(subdivisions=3)
    for kind in ("stl", "stl_ascii"):
        data = sphere.export(file_type=kind)
        data = data.encode() if isinstance(data, str) else data
        theirs = trimesh.load_mesh(io.BytesIO(data), file_type="stl", process=False)
        mesh = read(data)
        np.testing.assert_array_equal(mesh.vertices[mesh.faces], theirs.triangles)


@pytest.mark.parametrize("between", [b"", b"\n\n", b"a comment\n", b"\0\0"])
def test_solids_are_a_column(between: bytes) -> None:
    data = solid(b" a") + between + solid(b" empty", b"") + between + solid(b" a", SHIFTED) + between
    mesh = read(data)
    assert mesh.columns["solid"].values.tolist() == [0] * 12 + [1] * 12
    assert not mesh.columns["solid"].are_ids
    np.testing.assert_allclose(mesh.vertices[36:], mesh.vertices[:36] + np.array([10, 0, 0]), atol=1e-4)


def coloured(attributes: list[int], header: bytes = b"") -> bytes:
    records = [
        BINARY[84 + 50 * i : 132 + 50 * i] + struct.pack("<H", attributes[i % len(attributes)]) for i in range(12)
    ]
    return header.ljust(80) + BINARY[80:84] + b"".join(records)


@pytest.mark.parametrize(
    ("attributes", "header", "expected"),
    [
        ([0x8001, 0x8002, 0x8001, 0xFFFF], b"", [0, 1, 0, 2]),
        ([0x8001, 3, 0x8001, 4], b"", [0, 1, 0, 1]),  # VisCAM: bit 15 clear is no colour
        ([1, 0x8003, 2, 0x8004], b"COLOR=\x10\x20\x30\xff", [0, 1, 2, 1]),  # Magics: bit 15 set is the part's colour
        ([7, 8], b"", None),
        ([0x8001], b"", None),
    ],
)
def test_colours_of_binary_files(attributes: list[int], header: bytes, expected: list[int] | None) -> None:
    mesh = read(coloured(attributes, header))
    assert is_box(mesh)
    found = mesh.columns.get("colour")
    assert (None if found is None else found.values.tolist()) == (expected and expected * 3)


BAD: dict[str, tuple[bytes, str]] = {
    "words": (b"hello", "cannot be read as stl"),
    "noise": (bytes(range(256)) * 3, "it declares 1397903696 faces and holds 13"),
    "binary cut": (BINARY[:-70], "it declares 12 faces and holds 10"),
    "binary of many faces": (BINARY[:80] + struct.pack("<I", 4_000_000_000) + BINARY[84:], "declares 4000000000 faces"),
    "no count, no whole records": (BINARY[:80] + struct.pack("<I", 0) + BINARY[84:-7], "it declares no faces"),
    "text cut in a facet": (TEXT[: TEXT.index(b"endloop")], "truncated: it begins 1 facets and ends 0"),
    "text cut in a number": (TEXT[: TEXT.rindex(b"vertex") + 9], "truncated: it begins 12 facets and ends 11"),
    "text cut in a keyword": (TEXT[: TEXT.rindex(b"endfacet") + 3], "truncated: it begins 12 facets and ends 11"),
    "text cut between facets": (
        TEXT[: TEXT.rindex(b"facet normal")], "no endsolid follows its 11 facets, which do not close"
    ),
    "comma": (TEXT.replace(b"vertex 4.0", b"vertex 4,0", 1), "has '4,0' for a number in line 4: write numbers"),
    "word": (TEXT.replace(b"vertex 4.0", b"vertex x", 1), "has 'x' for a number in line 4"),
    "two numbers": (re.sub(rb"(vertex \S+ \S+) \S+", rb"\1", TEXT, count=1), "line 2 is not a facet"),
    "four vertices": (re.sub(rb"(vertex[^\n]*\n)", rb"\1\1", TEXT, count=1), "line 2 is not a facet"),
    "misspelt": (TEXT.replace(b"outer loop", b"outer lop", 1), "line 2 is not a facet"),
    "misspelt in the last facet": (b"endloup".join(TEXT.rsplit(b"endloop", 1)), "line 79 is not a facet"),
    "a facet outside of a solid": (TEXT + FACETS, "line 88 is not a facet"),
    "a wrong line between facets": (TEXT.replace(b"endfacet\n", b"endfacet\nhello\n", 1), "line 9 is not a facet"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_a_bad_file_is_one_line(case: str) -> None:
    data, message = BAD[case]
    assert message in refusal(data)


SOLIDS = solid(b" a") + solid(b" b", SHIFTED)


@pytest.mark.parametrize("data", [BINARY, TEXT, SOLIDS], ids=["binary", "text", "solids"])
def test_no_cut_is_taken_for_whole(data: bytes, caplog: pytest.LogCaptureFixture) -> None:
    faces = len(read(data).faces)
    refused = 0
    for end in range(len(data)):
        caplog.clear()
        try:
            mesh = read(data[:end])
        except InputError:
            refused += 1
            continue
        held = data.count(b"endfacet", 0, end)
        assert data is not BINARY
        assert len(mesh.faces) == held
        assert held in (0, 12, faces), "no more than whole solids are accepted"
        _, ended, after = data[:end].rpartition(b"endfacet")[2].rpartition(b"endsolid")
        is_ended = ended and b"\nsolid" not in after
        assert (f"no endsolid follows its {held} facets" in caplog.text) == (held > 0 and not is_ended)
    assert refused > 0.9 * len(data) - 100


@pytest.mark.parametrize("data", [BINARY, TEXT], ids=["binary", "text"])
def test_any_flipped_bit_is_one_line_or_a_mesh(data: bytes) -> None:
    meshes, lines = read_flipped(read, data, 400)
    assert all(len(mesh.faces) == 12 for mesh in meshes)
    assert data is BINARY or len(lines) > 100


def test_single_precision_far_from_the_origin_is_said(caplog: pytest.LogCaptureFixture) -> None:
    far = trimesh.Trimesh(BOX.vertices + np.array([1e5, 0, 0]), BOX.faces, process=False)
    read(far.export(file_type="stl"))
    assert "a.stl: far from the origin, its 32-bit coordinates are rounded to 0.0078 (0.2 % of the size)" in caplog.text
