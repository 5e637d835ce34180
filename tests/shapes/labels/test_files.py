"""Label files by their ending."""

import gzip
import json
from pathlib import Path

import numpy as np
import pytest
from mesh_files import BOX, SIDES, exported, put

from jointsdf.errors import InputError
from jointsdf.shapes.labels.files import read_labels
from jointsdf.shapes.readers.file_mesh import FileMesh

MESH = FileMesh(np.array(BOX.vertices), np.array(BOX.faces))
PATCHES = np.repeat(np.arange(6), 2)
TEXT = "\n".join(map(str, SIDES))


def write(path: Path, labels: np.ndarray) -> Path:
    """Write labels in the format that the name says."""
    kind = path.suffix
    if kind == ".npy":
        np.save(path, labels)
    elif kind == ".npz":
        np.savez(path, labels)
    elif kind == ".json":
        path.write_text(json.dumps(labels.tolist()))
    else:
        path.write_text("\n".join(map(str, labels.tolist())))
    return path


@pytest.mark.parametrize("name", ["a.npy", "a.npz", "a.txt", "a.csv", "a.json", "a.seg"])
@pytest.mark.parametrize("kind", [np.int16, np.float32])
def test_every_format_gives_the_same_labels(tmp_path: Path, name: str, kind: type) -> None:
    assert (
        read_labels(write(tmp_path / name, (SIDES * 50 - 1).astype(kind)), MESH).tolist() == (SIDES * 50 - 1).tolist()
    )


def test_names_in_capitals_and_compressed_files(tmp_path: Path) -> None:
    assert read_labels(put(tmp_path, "A.TXT", TEXT), MESH).tolist() == SIDES.tolist()
    assert read_labels(put(tmp_path, "a.txt.gz", gzip.compress(TEXT.encode())), MESH).tolist() == SIDES.tolist()
    with pytest.raises(InputError, match="is truncated: its gzip stream ends early"):
        read_labels(put(tmp_path, "b.txt.gz", gzip.compress(TEXT.encode())[:-9]), MESH)


def test_seg_is_one_label_for_each_brep_face(tmp_path: Path) -> None:
    path = put(tmp_path, "a.seg", "5\n4\n3\n2\n1\n0\n")
    assert read_labels(path, MESH, PATCHES).tolist() == (5 - PATCHES).tolist()
    each = put(tmp_path, "b.seg", "\n".join(map(str, range(12))))
    assert read_labels(each, MESH, np.arange(12)[::-1]).tolist() == list(range(12))[::-1], "B-rep faces come first"


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        (
            "a.h5",
            b"\x89HDF\r\n\x1a\n" + bytes(9),
            "is an HDF5 file: read are .npy, .npz, .txt, .csv, .json, .seg, .xyzc",
        ),
        ("a.pkl", b"\x80\x04K\x01.", "is a Python pickle, which is never read: read are .npy"),
        ("a.mat", b"MATLAB 5.0", "is a MATLAB file: read are"),
        ("a", b"1\n2\n", "is text: read are"),
        ("a.lbl", b"\x00\x80\xff", "is binary, of no known kind: read are"),
        ("a.dat", exported("ply"), "is a mesh or CAD file (PLY): read are"),
        ("a.png", b"\x89PNG\r\n", "is a picture: read are"),
        ("a.npy.bak", b"", "is empty: read are"),
        ("a.txt", b"1\n2\n3\n", "has 3 labels, the mesh has 12 faces, 8 vertices"),
        ("a.txt", b"1\n-2\n3\n", "holds -2: part ids are integers from -1"),
        ("a.json", b"[[1, 2]]", "holds '[1, 2]'"),
    ],
)
def test_other_files_are_refused_by_what_they_are(tmp_path: Path, name: str, content: bytes, message: str) -> None:
    path = put(tmp_path, name, content)
    with pytest.raises(InputError) as caught:
        read_labels(path, MESH)
    assert f"labels file {path} {message}" in str(caught.value)
    assert "\n" not in str(caught.value)
