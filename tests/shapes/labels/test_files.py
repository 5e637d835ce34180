from pathlib import Path

import numpy as np
import pytest
from solids import strip

from jointsdf.errors import InputError
from jointsdf.shapes.labels.files import number_by_area, read_labels


def per_rectangle(labels: np.ndarray) -> list[int]:
    assert (labels[::2] == labels[1::2]).all()
    return labels[::2].tolist()


def test_numbers_fall_with_area_and_keep_unlabelled() -> None:
    mesh = strip([1, 5, 2, 9, 3], [40, 3, -1, 11, 3])
    assert per_rectangle(number_by_area(mesh)) == [2, 1, -1, 0, 1]
    assert per_rectangle(number_by_area(strip([1, 2], [-1, -1]))) == [-1, -1]


@pytest.mark.parametrize("dtype", [np.int8, np.int32, np.int64, np.uint16, ">i4"])
@pytest.mark.parametrize("column", [False, True])
def test_reads_any_integers_and_keeps_original_ids(tmp_path: Path, dtype: str, column: bool) -> None:
    ids = np.array([0, 120, 7, 7], dtype=dtype)
    np.save(tmp_path / "labels.npy", ids[:, None] if column else ids)
    labels = read_labels(tmp_path / "labels.npy", 4)
    assert labels.dtype == np.int64
    assert labels.tolist() == [0, 120, 7, 7]


BAD_LABELS = {
    "wrong length": (np.arange(5), "5 labels, the mesh file has 12 faces"),
    "below -1": (np.array([0] * 11 + [-2]), "holds -2"),
    "float": (np.zeros(12), "float64"),
    "boolean": (np.zeros(12, dtype=bool), "bool"),
    "two columns": (np.zeros((12, 2), dtype=int), "shape (12, 2)"),
    "a scalar": (np.array(3), "shape ()"),
    "beyond int64": (np.full(12, 2**64 - 1, dtype=np.uint64), "64-bit"),
    "pickled objects": (np.array([{}] * 12, dtype=object), "pickled"),
}


@pytest.mark.parametrize("case", BAD_LABELS)
def test_bad_labels_are_one_line_that_names_the_file(tmp_path: Path, case: str) -> None:
    array, message = BAD_LABELS[case]
    path = tmp_path / "labels.npy"
    np.save(path, array, allow_pickle=True)
    with pytest.raises(InputError) as caught:
        read_labels(path, 12)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_damaged_label_files_are_input_errors_wherever_they_are_cut(tmp_path: Path) -> None:
    path = tmp_path / "labels.npy"
    np.save(path, np.arange(12))
    whole = path.read_bytes()
    for end in range(len(whole)):
        path.write_bytes(whole[:end])
        with pytest.raises(InputError, match="truncated"):
            read_labels(path, 12)
    for content in (b"0\n1\n2\n", b"\x00" * 200, b"PK\x03\x04 no archive"):
        path.write_bytes(content)
        with pytest.raises(InputError):
            read_labels(path, 12)


def test_an_archive_of_arrays_is_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "labels.npz", np.arange(12))
    with pytest.raises(InputError, match=r"no \.npy"):
        read_labels(tmp_path / "labels.npz", 12)


@pytest.mark.parametrize("content", ["0\n120\n-1\n7\n", "\ufeff0\r\n120\r\n-1\r\n7", "  0\n+120 \n-1\n7\n\n\n"])
def test_reads_one_integer_per_line_of_a_text(tmp_path: Path, content: str) -> None:
    path = tmp_path / "labels.TXT"
    path.write_bytes(content.encode())
    assert read_labels(path, 4).tolist() == [0, 120, -1, 7]


BAD_TEXTS = {
    "empty": ("", "is empty"),
    "blank": ("\n \n", "is empty"),
    "floats": ("1\n2\n0.5\n3\n", "has '0.5' in line 3: write one integer per line"),
    "round floats": ("1.0\n2.0\n3.0\n4.0\n", "has '1.0' in line 1"),
    "two in a line": ("1 2\n3 4\n", "has '1 2' in line 1"),
    "a gap": ("1\n\n2\n3\n", "has '' in line 2"),
    "words": ("shaft\nflange\nshaft\nshaft\n", "has 'shaft' in line 1"),
    "another mesh's": ("1\n2\n3\n", "has 3 labels, the mesh file has 4 faces"),
    "below -1": ("1\n2\n-2\n4\n", "holds -2"),
    "beyond 64 bits": ("1\n2\n3\n99999999999999999999\n", "line 4"),
    "other digits": ("1\n2\n3\n\u0664\n", "line 4"),
    "underscores": ("1\n2\n3\n1_0\n", "line 4"),
}


@pytest.mark.parametrize("case", BAD_TEXTS)
def test_bad_texts_are_one_line_that_names_the_file(tmp_path: Path, case: str) -> None:
    content, message = BAD_TEXTS[case]
    path = tmp_path / "labels.txt"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_labels(path, 4)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_bytes_that_are_no_text(tmp_path: Path) -> None:
    (tmp_path / "labels.txt").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="is no text"):
        read_labels(tmp_path / "labels.txt", 4)
