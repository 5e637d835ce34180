from pathlib import Path

import numpy as np
import pytest

from jointsdf.shapes.labels import border_lengths, face_areas, merged, numbered_by_area, read
from jointsdf.values import InputError, LabelledMesh


def strip(widths: list, labels: list[int], height: float = 1.0) -> LabelledMesh:
    """Rectangles side by side in the plane, two faces each, one label per rectangle."""
    x = np.concatenate([[0.0], np.cumsum(widths)])
    vertices = np.stack([np.repeat(x, 2), np.tile([0.0, height], len(x)), np.zeros(2 * len(x))], axis=1)
    first = 2 * np.arange(len(widths))[:, None]
    faces = np.concatenate([first + np.array(face) for face in ([0, 2, 1], [2, 3, 1])], axis=1).reshape(-1, 3)
    return LabelledMesh(vertices, faces, np.repeat(labels, 2))


def per_rectangle(labels: np.ndarray) -> list[int]:
    assert (labels[::2] == labels[1::2]).all()
    return labels[::2].tolist()


def test_areas_and_border_lengths_of_a_strip() -> None:
    mesh = strip([2, 1, 4, 3], [7, 5, 5, -1], height=3.0)
    np.testing.assert_allclose(face_areas(mesh), [3, 3, 1.5, 1.5, 6, 6, 4.5, 4.5])
    np.testing.assert_allclose(border_lengths(mesh), [[0, 3], [3, 0]])


def test_border_of_a_cube_is_each_edge_once() -> None:
    corners = np.array([[x, y, z] for x in (0.0, 2) for y in (0.0, 2) for z in (0.0, 2)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    lengths = border_lengths(LabelledMesh(corners, faces, np.repeat(np.arange(6), 2)))
    opposite = np.kron(np.eye(3), np.ones((2, 2)))
    np.testing.assert_allclose(lengths, 2.0 * (1 - opposite))


def test_numbers_fall_with_area_and_keep_unlabelled() -> None:
    mesh = strip([1, 5, 2, 9, 3], [40, 3, -1, 11, 3])
    assert per_rectangle(numbered_by_area(mesh)) == [2, 1, -1, 0, 1]
    assert per_rectangle(numbered_by_area(strip([1, 2], [-1, -1]))) == [-1, -1]


def test_smallest_part_goes_to_its_longest_border() -> None:
    # A 1 x 1 square (label 9) above the joint of a 3 x 1 and a 2 x 1 rectangle: borders 0.7 and 0.3 long.
    vertices = np.array(
        [[0, 0, 0], [3, 0, 0], [5, 0, 0], [0, 1, 0], [2.3, 1, 0], [3, 1, 0], [3.3, 1, 0], [5, 1, 0], [2.3, 2, 0],
         [3.3, 2, 0]], dtype=float)  # fmt: skip
    faces = np.array(
        [[0, 1, 3], [1, 4, 3], [1, 5, 4], [1, 2, 5], [2, 6, 5], [2, 7, 6], [4, 5, 8], [5, 9, 8], [5, 6, 9]]
    )
    mesh = LabelledMesh(vertices, faces, np.array([4, 4, 4, 2, 2, 2, 9, 9, 9]))
    np.testing.assert_allclose(border_lengths(mesh), [[0, 1, 0.3], [1, 0, 0.7], [0.3, 0.7, 0]])
    assert merged(mesh, 2).tolist() == [0, 0, 0, 1, 1, 1, 0, 0, 0]


def test_merging_chains_through_merged_parts() -> None:
    # Areas 1, 2, 4, 9: the first joins the second, and the pair of area 3 is then the smallest and joins the third.
    mesh = strip([1, 2, 4, 9], [3, 0, 1, 2])
    assert per_rectangle(merged(mesh, 3)) == [2, 2, 1, 0]
    assert per_rectangle(merged(mesh, 2)) == [1, 1, 1, 0]
    assert per_rectangle(merged(mesh, 1)) == [0, 0, 0, 0]
    assert per_rectangle(merged(mesh, 18)) == [3, 2, 1, 0]


def test_part_without_neighbour_goes_last_and_to_the_nearest() -> None:
    mesh = strip([5, 1, 1.5, 6.5, 0.5, 1, 7], [0, 1, -1, 3, -1, 5, -1])  # 1 touches 0; 3 and 5 touch nothing
    assert per_rectangle(merged(mesh, 3)) == [1, 1, -1, 0, -1, 2, -1]
    assert per_rectangle(merged(mesh, 2)) == [1, 1, -1, 0, -1, 0, -1]


@pytest.mark.parametrize("seed", range(5))
def test_merging_random_strips_keeps_parts_whole(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mesh = strip(list(rng.uniform(0.1, 3, 60)), list(rng.integers(-1, 30, 60)))
    labels = merged(mesh, 7)
    assert sorted(set(labels.tolist()) - {-1}) == list(range(7))
    np.testing.assert_array_equal(labels == -1, mesh.labels == -1)
    for part in mesh.part_ids:
        assert len(set(labels[mesh.labels == part].tolist())) == 1
    areas = np.bincount(labels[labels >= 0], face_areas(mesh)[labels >= 0])
    assert (np.diff(areas) <= 0).all()


@pytest.mark.parametrize("dtype", [np.int8, np.int32, np.int64, np.uint16, ">i4"])
@pytest.mark.parametrize("column", [False, True])
def test_reads_any_integers_and_keeps_original_ids(tmp_path: Path, dtype: str, column: bool) -> None:
    ids = np.array([0, 120, 7, 7], dtype=dtype)
    np.save(tmp_path / "labels.npy", ids[:, None] if column else ids)
    labels = read(tmp_path / "labels.npy", 4)
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
        read(path, 12)
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
            read(path, 12)
    for content in (b"0\n1\n2\n", b"\x00" * 200, b"PK\x03\x04 no archive"):
        path.write_bytes(content)
        with pytest.raises(InputError):
            read(path, 12)


def test_an_archive_of_arrays_is_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "labels.npz", np.arange(12))
    with pytest.raises(InputError, match=r"no \.npy"):
        read(tmp_path / "labels.npz", 12)
