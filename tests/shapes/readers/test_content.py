"""Formats told by name and content, words for those that are not read, and compressed files."""

import gzip
import hashlib
import io
import os
import tracemalloc
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest
from mesh_files import OBJ, OFF, PLY, exported, load, put
from step_files import ONE, step_boxes

from jointsdf.errors import InputError
from jointsdf.shapes.readers.content import read_content
from jointsdf.shapes.readers.formats import ALIASES, FORMATS, READ, UNREAD
from jointsdf.shapes.readers.recognition import SIGNATURES, recognise

ROOT = Path(__file__).parents[3]
GLTF = '{"asset": {"version": "2.0"}, "meshes": []}'


def refusal(path: Path) -> str:
    with pytest.raises(InputError) as caught:
        read_content(path)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)
    return str(caught.value)


def packed(*members: str) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for member in members:
            archive.writestr(member, "content")
    return stream.getvalue()


def array() -> bytes:
    stream = io.BytesIO()
    np.save(stream, np.arange(3))
    return stream.getvalue()


CONTENTS: dict[str, bytes | str] = {
    "ply": PLY, "obj": OBJ, "off": OFF, "glb": exported("glb"), "gltf": GLTF, "step": step_boxes(ONE),
    "stl": exported("stl_ascii"),
    "igs": f"{'a part':72}S      1\n{'1H,,1H;':72}G      1\n",
    "x_t": "**ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789**\n**PARASOLID\n", "sat": "700 0 1 0\n11 Autodesk 19 ASM 223.0\n",
    "brep": "DBRep_DrawableShape\n", "jt": "Version 9.5 JT  DM", "3dm": "3D Geometry File Format        5",
    "dwg": "AC1032\0\0", "dxf": "  0\nSECTION\n  2\nHEADER\n", "catpart": b"V5_CFV2\0\0", "prt": "#UGC:2 PART 1",
    "ole": b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1\0\0", "skp": b"\xff\xfe\xff\x0eS\0k\0e\0t\0c\0h\0U\0p\0",
    "fbx": b"Kaydara FBX Binary  \0", "blend": "BLENDER-v300", "usd": "#usda 1.0\n", "wrl": "#VRML V2.0 utf8\n",
    "amf": '<?xml version="1.0"?>\n<!-- by a program -->\n<amf unit="millimeter">',
    "dae": '<?xml version="1.0"?><COLLADA>',
    "vtk": "# vtk DataFile Version 3.0\n",
    "html": "<!DOCTYPE html>\n<html><body>404</body></html>", "drc": b"DRACO\2\2",
    "msh": "$MeshFormat\n4.1 0 8\n", "inp": "** a comment\n*Heading\n", "bdf": "SOL 101\nCEND\nBEGIN BULK\nGRID,1\n",
    "xyz": "# .PCD v0.7\nVERSION 0.7\n", "7z": b"7z\xbc\xaf\x27\x1c\0\4", "rar": b"Rar!\x1a\x07\x01\0",
    "e57": b"ASTM-E57\1\0",
    "zip": packed("part.stl"), "3mf": packed("[Content_Types].xml", "3D/3dmodel.model"), "npy": array(),
    "fcstd": packed("Document.xml"), "gz": gzip.compress(PLY.encode()), "bz2": b"BZh91AY&SY\0",
    "png": b"\x89PNG\r\n\x1a\n",
    "pdf": "%PDF-1.7\n", "json": '{"labels": [1, 2]}', "utf16": PLY.encode("utf-16"),
    "lfs": "version https://git-lfs.github.com/spec/v1\noid sha256:ab\nsize 9\n",
}  # fmt: skip


def content(key: str) -> bytes:
    data = CONTENTS[key]
    return data.encode() if isinstance(data, str) else data


@pytest.mark.parametrize("key", CONTENTS)
def test_content_is_recognised(key: str) -> None:
    assert recognise(content(key)) == key
    assert key in READ.values() or key in UNREAD


def test_every_signature_has_a_content_here_and_every_alias_a_kind() -> None:
    assert SIGNATURES.keys() <= CONTENTS.keys()
    assert set(ALIASES.values()) <= UNREAD.keys()
    assert not set(FORMATS) & (ALIASES.keys() | UNREAD.keys())


@pytest.mark.parametrize("data", [b"", b"hello", b"0 0 1\n1 0 0\n", bytes(range(256)) * 4, b"vertex v 1 2 3\nf 1"])
def test_content_that_may_be_anything_is_not_recognised(data: bytes) -> None:
    assert recognise(data) == ""


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("held", sorted(set(READ.values())))
def test_content_of_another_format_is_named_with_the_fix(tmp_path: Path, suffix: str, held: str) -> None:
    for name, data in ((f"a.B.{suffix.upper()}", content(held)), (f"a.B.{suffix}.gz", gzip.compress(content(held)))):
        path = put(tmp_path, name, data)
        if READ[suffix] == held:
            found = read_content(path)
            assert (found.format, found.data) == (held, content(held))
            assert found.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
            continue
        packing = ".gz" if name.endswith(".gz") else ""
        message = f"holds {held.upper()}, not {READ[suffix].upper()} as its name says: rename it to a.B.{held}{packing}"
        assert message in refusal(path)


def test_a_binary_stl_is_one_whatever_its_header_says(tmp_path: Path) -> None:
    for words in (b"ply\n", b"OFF ", b"glTF", b"ISO-10303-21;", b"PK\x03\x04", b"%PDF-"):
        data = words.ljust(80) + exported("stl")[80:]
        assert read_content(put(tmp_path, "a.stl", data)).format == "stl"
        assert "rename it to a.stl" in refusal(put(tmp_path, "a.ply", data))


@pytest.mark.parametrize("key", [key for key in CONTENTS if key in UNREAD])
def test_content_that_is_not_read_is_named_whatever_the_file_is_called(tmp_path: Path, key: str) -> None:
    for name in ("a.stl", "a.ply", "a.step"):
        assert f"is {UNREAD[key].name}: {UNREAD[key].fix}" in refusal(put(tmp_path, name, content(key)))


def test_a_pipe_is_refused_rather_than_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.stl")
    assert "is a pipe or device" in refusal(tmp_path / "a.stl")


def test_utf_16_is_left_to_the_reader_of_obj(tmp_path: Path) -> None:
    for name, data in (("a.obj", OBJ.encode("utf-16")), ("a.obj.gz", gzip.compress(OBJ.encode("utf-16")))):
        assert read_content(put(tmp_path, name, data)).format == "obj"
        assert len(load(tmp_path / name).mesh.faces) == 4


@pytest.mark.parametrize("suffix", sorted(UNREAD.keys() | ALIASES.keys() - {"gz"}))
def test_names_that_are_not_read_say_what_they_are(tmp_path: Path, suffix: str) -> None:
    if suffix in ("gz", "lfs", "utf16", "ole"):  # known by content alone
        return
    unread = UNREAD[ALIASES.get(suffix, suffix)]
    for name in (f"a.{suffix}", f"a.{suffix.upper()}"):
        assert f"{name} is {unread.name}: {unread.fix}" in refusal(put(tmp_path, name, "some text"))


@pytest.mark.parametrize(
    ("name", "key", "words"),
    [
        ("a.igs", "step", "holds STEP, which its name does not say: rename it to a.step"),
        ("a", "obj", "holds OBJ, which its name does not say: rename it to a.obj"),
        ("a.gz", "ply", "rename it to a.ply.gz"),
        ("a.sldprt", "ole", "is a SolidWorks file: export it as STEP"),
        ("a.f3d", "zip", "is an Autodesk Fusion file: export it as STEP"),
        ("a.las", "xyz", "is a point cloud: a mesh is needed"),
        ("a.stp", "html", "is a web page, such as that of a failed download: download the file again"),
        ("a.igs", "lfs", "is a pointer of git-lfs in place of the file: fetch it by git lfs pull"),
        ("a.stl", "gz", "is compressed by gzip, which its name does not say: give its name the ending .gz"),
    ],
)
def test_of_name_and_content_the_better_word_is_given(tmp_path: Path, name: str, key: str, words: str) -> None:
    data = gzip.compress(content(key)) if name.endswith(".gz") else content(key)
    assert words in refusal(put(tmp_path, name, data))


def test_an_unknown_name_lists_every_format(tmp_path: Path) -> None:
    message = refusal(put(tmp_path, "a.what", "x"))
    assert f"format what is not read; use one of {', '.join(FORMATS)} (also .gz)" in message
    assert "format without suffix is not read" in refusal(put(tmp_path, "a", "x"))


@pytest.mark.parametrize("data", [b"", b"\n\n", bytes(100)])
def test_a_file_of_nothing_is_empty(tmp_path: Path, data: bytes) -> None:
    assert "is empty" in refusal(put(tmp_path, "a.ply", data))
    assert "is empty" in refusal(put(tmp_path, "a.ply.gz", gzip.compress(data)))


def test_missing_files_and_what_is_no_file(tmp_path: Path) -> None:
    assert "file not found: " in refusal(tmp_path / "no.ply")
    assert "is a folder" in refusal(tmp_path)


def test_gzip_of_several_members_and_padding(tmp_path: Path) -> None:
    data = content("obj") * 20_000
    parts = [gzip.compress(data[:1000]), gzip.compress(b""), gzip.compress(data[1000:]), bytes(100)]
    assert read_content(put(tmp_path, "a.obj.gz", b"".join(parts))).data == data


def test_cut_and_damaged_gzip_is_one_line(tmp_path: Path) -> None:
    data = gzip.compress(content("step"))
    for end in range(1, len(data), 97):
        assert "is truncated: its gzip stream ends early" in refusal(put(tmp_path, "a.stp.gz", data[:end]))
    middle = len(data) // 2
    damaged = data[:middle] + bytes([data[middle] ^ 255]) + data[middle + 1 :]
    assert "is no gzip file, or damaged" in refusal(put(tmp_path, "a.stp.gz", damaged))
    assert "is no gzip file, or damaged" in refusal(put(tmp_path, "a.stp.gz", content("step")))
    assert "is no gzip file, or damaged" in refusal(put(tmp_path, "a.stp.gz", data + b"more"))


def test_a_gzip_bomb_fills_no_memory(tmp_path: Path) -> None:
    packer = zlib.compressobj(9, zlib.DEFLATED, 31)
    zeros = bytes(1 << 24)
    path = put(tmp_path, "a.ply.gz", b"".join(packer.compress(zeros) for _ in range(8)) + packer.flush())
    tracemalloc.start()
    message = refusal(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert "no mesh; give it decompressed" in message
    assert peak < 1 << 27  # the bytes that it holds


@pytest.mark.parametrize("path", ["jointsdf/shapes/loading.py", "jointsdf/api.py", "docs/files.md"])
def test_every_format_is_in_the_documentation(path: str) -> None:
    text = (ROOT / path).read_text(encoding="utf-8")
    assert [name for name in (*FORMATS, "gz") if name not in text.replace("/", " ")] == []
