"""Points of files, read piece by piece: the same points whatever the format and the size of the pieces."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from jointsdf.asking import point_files
from jointsdf.asking.point_files import read_pieces
from jointsdf.errors import InputError

POINTS = np.random.default_rng(0).uniform(-9, 9, (500, 3))


def text(points: np.ndarray, separator: str = " ", head: str = "") -> bytes:
    return (head + "".join(separator.join(map(repr, row)) + "\n" for row in points.tolist())).encode()


def ply(points: np.ndarray) -> bytes:
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    head += "".join(f"property double {axis}\n" for axis in "xyz") + "element face 1\n"
    head += "property list uchar int vertex_indices\nend_header\n"
    return head.encode() + points.tobytes() + b"\x03" + np.array([0, 1, 2], "<i4").tobytes()


def write(path: Path) -> Path:
    kind = path.name.partition(".")[2]
    if kind in ("npy", "named.npy"):
        fields = np.rec.fromarrays([POINTS[:, 0] * 0, *POINTS.T], names="time,x,y,z")
        np.save(path, POINTS if kind == "npy" else np.asarray(fields))
    elif kind == "more.npy":
        np.save(path, np.concatenate([POINTS, POINTS], axis=1))
    else:
        path.write_bytes(
            {
                "xyz": text(POINTS),
                "csv": text(POINTS, ",", "x,y,z\n"),
                "turned.csv": text(np.concatenate([POINTS * 0, POINTS[:, ::-1]], 1), ";", "# a b c Z Y X\n"),
                "txt.gz": gzip.compress(text(POINTS, "\t")),
                "ply": ply(POINTS),
            }[kind]
        )
    return path


@pytest.mark.parametrize("small", [True, False])
@pytest.mark.parametrize(
    "name", ["a.xyz", "a.csv", "a.turned.csv", "a.txt.gz", "a.ply", "a.npy", "a.named.npy", "a.more.npy"]
)
def test_the_points_are_the_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, small: bool) -> None:
    path = write(tmp_path / name)
    if small:
        monkeypatch.setattr(point_files, "PIECE", 37)
        monkeypatch.setattr(point_files, "BLOCK", 211)
    pieces = list(read_pieces(path))
    assert (len(pieces) > 5) == small
    np.testing.assert_array_equal(np.concatenate([piece.points for piece in pieces]), POINTS)
    shares = [piece.share for piece in pieces]
    assert shares == sorted(shares)
    assert shares[-1] == 1
    assert shares[0] < 0.1 or not small


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.csv", b"x,y,z\n1,2,3\n4,5,nan\n", r"point 2 is \[4\.0, 5\.0, nan\]; give finite coordinates"),
        ("a.csv", b"x,y,z\n1,2,3\n1,2,3\n4,5\n", "rows of equally many numbers are needed near line 4"),
        ("a.csv", b"x,y\n1,2\n", "has 'x y' where x y z is needed"),
        ("a.xyz", b"1 2\n3 4\n", "has 2 numbers in each line"),
        ("a.csv", b"x,y,z\n", "where x y z is needed"),
        ("a.csv", b"", "holds no points"),
        ("a.xyz", b"1 2 3\n\0\0", "is no text"),
        ("a.npy", b"\x93NUMPY junk", "is pickled, truncated, damaged or no .npy"),
        ("a.obj", b"v 1 2 3\n", "no file of points; give one of ply, xyz"),
        ("b.csv", None, "file not found"),
    ],
)
def test_what_is_no_file_of_points_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, content: bytes | None, message: str
) -> None:
    monkeypatch.setattr(point_files, "BLOCK", 13)
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        list(read_pieces(tmp_path / name))
    assert "\n" not in str(caught.value)


def test_pickled_arrays_are_not_loaded(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.array([[object(), 1, 2]]), allow_pickle=True)
    with pytest.raises(InputError, match="pickled"):
        list(read_pieces(tmp_path / "a.npy"))
    np.save(tmp_path / "b.npy", np.zeros((4, 2)))
    with pytest.raises(InputError, match=r"has shape \(4, 2\) of float64"):
        list(read_pieces(tmp_path / "b.npy"))
