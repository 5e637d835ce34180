"""Points, normals, colours and columns come back from files of every format; damaged ones are one line."""

import gzip
import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import plyfile
import pytest
from cloud_files import as_text, colours_of, lzf_literals, npy, npz, on_box, pcd, ply, written

from jointsdf.errors import InputError
from jointsdf.shapes.clouds import cloud_file
from jointsdf.shapes.clouds.cloud_file import choose_points, is_cloud_file, read_cloud
from jointsdf.shapes.clouds.file_cloud import FileCloud
from jointsdf.shapes.clouds.lzf import decompress

BOX = on_box()
STACKED = np.c_[BOX.points, BOX.normals, BOX.labels]
FIELDS = np.zeros(len(BOX), [(name, "f8") for name in ("X", "Y", "Z")] + [("part", "i4")])
for axis, field in enumerate("XYZ"):
    FIELDS[field] = BOX.points[:, axis]
FIELDS["part"] = BOX.labels
FILES: dict[str, tuple[str, Callable[[], bytes | list[str]], str]] = {  # name: (file, content, what it also holds)
    "ply": ("a.ply", lambda: ply(BOX), "normals colours part"),
    "xyz": ("a.xyz", lambda: as_text(BOX, normals=False, labels=False), ""),
    "xyz, a number": ("a.xyz", lambda: as_text(BOX, normals=False), "column4"),
    "xyzn": ("a.xyzn", lambda: as_text(BOX, labels=False), "normals"),
    "xyz, colours": ("a.xyz", lambda: as_text(BOX, normals=False, colours=True), "colours column7"),
    "xyzc": ("a.xyzc", lambda: as_text(BOX), "normals label"),
    "pts": ("a.pts", lambda: [str(len(BOX)), *as_text(BOX, normals=False, labels=False)], ""),
    "csv": ("a.csv", lambda: ["x,y,z,part", *(r.replace(" ", ",") for r in as_text(BOX, normals=False))], "part"),
    "csv, comment": (
        "a.csv",
        lambda: ["//X;Y;Z;R;G;B", *as_text(BOX, normals=False, colours=True, labels=False)],
        "colours",
    ),
    "npy": ("a.npy", lambda: npy(STACKED), "normals label"),
    "npy, fields": ("a.npy", lambda: npy(FIELDS), "part"),
    "npz": (
        "a.npz",
        lambda: npz(points=BOX.points, normals=BOX.normals, labels=BOX.labels, colors=colours_of(BOX)),
        "normals colours labels",
    ),
    "pcd, text": ("a.pcd", lambda: pcd(BOX, "ascii"), "label"),
    "pcd": ("a.pcd", lambda: pcd(BOX, "binary", gaps=7), "colours label"),
    "pcd, compressed": ("a.pcd", lambda: pcd(BOX, "binary_compressed"), "colours label"),
}


@pytest.mark.parametrize("packed", [False, True], ids=["plain", "gz"])
@pytest.mark.parametrize(("name", "content", "held"), FILES.values(), ids=FILES.keys())
def test_every_format_gives_the_points_and_what_the_file_says_of_them(
    tmp_path: Path, name: str, content: Callable[[], bytes | list[str]], held: str, packed: bool
) -> None:
    path = written(tmp_path, name, content())
    if packed:
        path = written(tmp_path, f"{name}.gz", gzip.compress(path.read_bytes()))
    assert is_cloud_file(path)
    cloud, _ = read_cloud(path)
    np.testing.assert_array_equal(cloud.points, BOX.points)
    words = held.split()
    if "normals" in words:
        np.testing.assert_allclose(cloud.normals, BOX.normals, atol=1e-15)
    assert (cloud.normals is None) == ("normals" not in words)
    if "colours" in words:
        np.testing.assert_array_equal(cloud.colours, colours_of(BOX))
    numbers = [word for word in words if word not in ("normals", "colours")]
    assert [key for key in cloud.columns if key != "rgb"] == numbers
    for number in numbers:
        np.testing.assert_array_equal(cloud.columns[number], BOX.labels)


def test_ply_clouds_are_read_as_an_independent_library_reads_them(tmp_path: Path) -> None:
    path = written(tmp_path, "a.ply", ply(BOX))
    vertex = plyfile.PlyData.read(path)["vertex"]
    np.testing.assert_array_equal(read_cloud(path)[0].points, np.stack([vertex[axis] for axis in "xyz"], axis=1))
    np.testing.assert_array_equal(read_cloud(path)[0].columns["part"], vertex["part"])


def test_las_is_read_by_the_library_and_named_where_it_is_missing(tmp_path: Path) -> None:
    laspy = pytest.importorskip("laspy", reason="the extra las is not installed")
    header = laspy.LasHeader(point_format=2)
    header.scales, header.offsets = np.full(3, 1e-6), np.zeros(3)
    las = laspy.LasData(header)
    las.xyz, las.classification = BOX.points, BOX.labels.astype(np.uint8)
    las.red, las.green, las.blue = (colours_of(BOX).astype(np.uint16) * 257).T
    buffer = io.BytesIO()
    las.write(buffer)
    cloud, _ = read_cloud(written(tmp_path, "a.las", buffer.getvalue()))
    np.testing.assert_allclose(cloud.points, BOX.points, atol=1e-6)
    np.testing.assert_array_equal(cloud.columns["classification"], BOX.labels)
    np.testing.assert_array_equal(cloud.colours, colours_of(BOX))


def test_without_the_library_las_names_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "laspy", None)
    with pytest.raises(InputError, match=r"a\.las: LAS needs a library: pip install"):
        read_cloud(written(tmp_path, "a.las", b"LASF" + bytes(400)))


def test_unit_and_up_are_those_of_the_ply_file(tmp_path: Path) -> None:
    cloud, _ = read_cloud(written(tmp_path, "a.ply", ply(BOX, comments="comment unit in 0.0254\ncomment up y")))
    assert cloud.unit is not None
    assert (cloud.unit.name, cloud.unit.metres, cloud.up) == ("in", 0.0254, "y")


def test_a_mesh_is_no_cloud(tmp_path: Path) -> None:
    faces = b"element face 1\nproperty list uchar int vertex_indices\nend_header"
    assert not is_cloud_file(written(tmp_path, "a.ply", ply(BOX).replace(b"end_header", faces, 1)))
    assert not is_cloud_file(written(tmp_path, "b.ply", b"ply\n"))
    assert not is_cloud_file(written(tmp_path, "a.stl", b""))
    assert not is_cloud_file(tmp_path / "missing.xyz")


@pytest.mark.parametrize("size", [1, 31, 32, 33, 1000])
def test_lzf_of_literals_is_what_was_packed(size: int) -> None:
    data = np.random.default_rng(size).bytes(size)
    assert decompress(lzf_literals(data), size) == data


def test_lzf_references_repeat_earlier_bytes_also_those_they_write() -> None:
    long = bytes([0, 7, 0xE0, 251, 0])  # 7 + 251 + 2 bytes, one back
    assert decompress(long, 261) == bytes([7]) * 261
    for damaged in (bytes([0x20]), bytes([0, 1, 0x20, 9]), bytes([5, 1]), bytes([0xE0, 1])):
        with pytest.raises(ValueError, match="block"):
            decompress(damaged, 100)


LINES = as_text(BOX, normals=False, labels=False)
BAD: dict[str, tuple[str, bytes | list[str], str]] = {
    "empty": ("a.xyz", b" \n", "is empty"),
    "words": ("a.xyz", ["the points", "of a part"], "has 'the points' where x y z is needed"),
    "two numbers": ("a.xyz", ["1 2", "3 4"], "has 2 numbers in each line"),
    "a longer row": ("a.xyz", [*LINES[:5], "1 2 3 4"], "rows of equally many numbers are needed near line 6"),
    "a word": ("a.csv", ["x,y,z", "1,2,3", "4,five,6"], "rows of equally many numbers are needed near line 3"),
    "other names": ("a.csv", ["a,b,c", "1,2,3"], "has 'a b c' where x y z is needed"),
    "no text": ("a.xyz", b"1 2 3\n\0\0", "is no text"),
    "a mesh in it": ("a.xyz", ply(BOX), "holds PLY, not XYZ as its name says"),
    "a picture": ("a.pcd", b"\x89PNG\r\n", "is a picture, not PCD as its name says"),
    "npy of two": ("a.npy", npy(np.zeros((9, 2))), r"has shape \(9, 2\) of float64"),
    "npy pickled": ("a.npy", npy(np.array([{}])), "is pickled, and no pickle is read"),
    "npz without points": ("a.npz", npz(a=np.zeros(3)), r"holds a \(3,\): an array `points`"),
    "npz of two lengths": ("a.npz", npz(points=BOX.points, labels=np.zeros(3)), "labels has 3 rows for 600 points"),
    "npz cut": ("a.npz", npz(points=BOX.points)[:-30], "is no .npz, or damaged"),
    "npy cut": ("a.npy", npy(STACKED)[:-30], "is truncated, damaged"),
    "ply cut": ("a.ply", ply(BOX)[:-30], "is truncated: it declares 600 vertices"),
    "pcd cut": ("a.pcd", pcd(BOX, "binary")[:-30], "is truncated or damaged: it does not hold its 600 points"),
    "pcd compressed and cut": ("a.pcd", pcd(BOX, "binary_compressed")[:-30], "is truncated or damaged"),
    "pcd text and cut": ("a.pcd", pcd(BOX, "ascii")[:-300], "is truncated or damaged"),
    "pcd without data": ("a.pcd", b"# .PCD v0.7\nFIELDS x y z\n", "its header has no DATA"),
    "pcd without fields": ("a.pcd", b"# .PCD v0.7\nPOINTS 3\nDATA ascii\n", "its header is incomplete"),
    "las": ("a.las", b"LASF" + bytes(100), "las"),
}


@pytest.mark.parametrize(("name", "content", "words"), BAD.values(), ids=BAD.keys())
def test_a_damaged_file_is_one_line(tmp_path: Path, name: str, content: bytes | list[str], words: str) -> None:
    path = written(tmp_path, name, content)
    with pytest.raises(InputError, match=words) as caught:
        read_cloud(path)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)


def test_a_missing_file_and_a_folder_are_one_line(tmp_path: Path) -> None:
    for path, words in ((tmp_path / "a.xyz", "file not found"), (tmp_path, "is a folder")):
        with pytest.raises(InputError, match=words):
            read_cloud(path)


PLACES = BOX.points
UNUSABLE = {
    "few": (PLACES[:199], "has 199 points: at least 200 are needed"),
    "nan": (np.where(np.arange(600)[:, None] == 5, np.nan, PLACES), "NaN or infinite coordinates in 1 points"),
    "huge": (PLACES * 1e40, "has a coordinate of 2.5e"),
    "one place": (np.ones((300, 3)), "all of its 300 points are one place"),
    "plane": (PLACES * [1, 1, 0], "lie in a plane"),
    "tilted plane": ((PLACES * [1, 1, 0]) @ np.array([[1, 2, 3], [0, 1, 1], [1, 0, 0.0]]) + 1e3, "lie in a plane"),
    "line": (PLACES * [1, 0, 0] + 7, "lie in a straight line"),
}


@pytest.mark.parametrize(("points", "words"), UNUSABLE.values(), ids=UNUSABLE.keys())
def test_what_is_no_surface_is_refused(points: np.ndarray, words: str) -> None:
    with pytest.raises(InputError, match=words):
        choose_points("scan", FileCloud(points))


def test_repeated_points_are_left_out_and_too_many_thinned(monkeypatch, caplog: pytest.LogCaptureFixture) -> None:
    twice = np.concatenate([PLACES, PLACES[:50]])
    np.testing.assert_array_equal(choose_points("scan", FileCloud(twice)), np.arange(600))
    assert "50 points repeat others exactly" in caplog.text
    monkeypatch.setattr(cloud_file, "MOST", 250)
    kept = choose_points("scan", FileCloud(PLACES))
    assert len(np.unique(kept)) == 250
    np.testing.assert_array_equal(kept, choose_points("scan", FileCloud(PLACES)))
    assert "600 points are thinned to 250" in caplog.text
