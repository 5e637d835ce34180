"""Arrays in `.npy` and `.npz` files."""

import gzip
import io
import pickle
from pathlib import Path

import numpy as np
import pytest
from mesh_files import put

from jointsdf.errors import InputError
from jointsdf.shapes.labels.array_files import flatten_column, read_archive, read_array


def npy(array: np.ndarray, **options: bool) -> bytes:
    file = io.BytesIO()
    np.save(file, array, **options)
    return file.getvalue()


def npz(**arrays: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)
    return file.getvalue()


NPY, NPZ = npy(np.arange(12)), npz(parts=np.arange(12))


def test_arrays_are_read_plain_and_compressed(tmp_path: Path) -> None:
    for array in (np.arange(12), np.arange(12.0)[:, None], np.zeros(12, dtype=bool), np.arange(3, dtype=">i4")):
        found = read_array(put(tmp_path, "a.npy", npy(array)))
        assert found.dtype == array.dtype
        np.testing.assert_array_equal(found, array)
    np.testing.assert_array_equal(read_array(put(tmp_path, "a.npy.gz", gzip.compress(NPY))), np.arange(12))


def test_an_archive_gives_its_only_array_or_that_of_the_right_name(tmp_path: Path) -> None:
    np.testing.assert_array_equal(read_archive(put(tmp_path, "a.npz", NPZ)), np.arange(12))
    both = npz(others=np.zeros(3), labels=np.arange(5))
    np.testing.assert_array_equal(read_archive(put(tmp_path, "b.npz", both)), np.arange(5))
    with pytest.raises(InputError, match="holds the arrays one, two: name one of them labels"):
        read_archive(put(tmp_path, "c.npz", npz(one=np.zeros(3), two=np.zeros(3))))


BAD_FILES: dict[str, tuple[str, bytes, str]] = {
    "empty": ("a.npy", b"", "is empty: save an integer array by numpy.save"),
    "zeros": ("a.npy", bytes(200), "is empty"),
    "text": ("a.npy", b"0\n1\n2\n", "is text, no .npy: name it .txt or .csv"),
    "an archive": ("a.npy", NPZ, "is a zip archive (.npz?), no .npy: name it .npz"),
    "a pickle": ("a.npy", pickle.dumps([1, 2]), "is a Python pickle, which is never read, no .npy"),
    "objects": ("a.npy", npy(np.array([{}]), allow_pickle=True), "is pickled, and no pickle is read"),
    "HDF5": ("a.npy", b"\x89HDF\r\n\x1a\n" + bytes(90), "is an HDF5 file, no .npy"),
    "MATLAB": ("a.npy", b"MATLAB 5.0 MAT-file" + bytes(90), "is a MATLAB file, no .npy"),
    "a mesh": ("a.npy", b"ply\nformat ascii 1.0\n", "is a mesh or CAD file (PLY), no .npy"),
    "a picture": ("a.npy", b"\x89PNG\r\n\x1a\n" + bytes(90), "is a picture, no .npy"),
    "bytes": ("a.npy", bytes(range(128, 256)), "is binary, of no known kind, no .npy"),
    "an array as archive": ("a.npz", NPY, "is a .npy array, no .npz: save an integer array by numpy.savez"),
    "a damaged archive": ("a.npz", NPZ[:-40], "is truncated or damaged"),
}


@pytest.mark.parametrize("case", BAD_FILES)
def test_bad_files_are_one_line_that_says_what_they_are(tmp_path: Path, case: str) -> None:
    name, content, message = BAD_FILES[case]
    path = put(tmp_path, name, content)
    with pytest.raises(InputError) as caught:
        (read_archive if name.endswith("npz") else read_array)(path)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("whole", "read"), [(NPY, read_array), (NPZ, read_archive)])
def test_files_cut_anywhere_are_refused(tmp_path: Path, whole: bytes, read: object) -> None:
    assert callable(read)
    for end in range(1, len(whole)):
        path = put(tmp_path, "a", whole[:end])
        with pytest.raises(InputError, match=r"truncated|no \.np|is empty"):
            read(path)


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be opened: No such file"):
        read_array(tmp_path / "a.npy")


def test_one_row_or_column_is_flat() -> None:
    for array in (np.arange(3), np.arange(3)[:, None], np.arange(3)[None]):
        assert flatten_column("it", array).tolist() == [0, 1, 2]
    for odd in (np.zeros((12, 2)), np.array(3), np.zeros((2, 1, 1))):
        with pytest.raises(InputError, match="it has shape"):
            flatten_column("it", odd)
