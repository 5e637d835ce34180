"""Labels of points: the usual columns, one that is named, colours, label files, none; and what is refused."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from cloud_files import as_text, npy, on_box, ply, written

from jointsdf.errors import InputError
from jointsdf.shapes.clouds.cloud_file import read_cloud
from jointsdf.shapes.clouds.cloud_labels import provide_labels

BOX = on_box()


def labels_of(path: Path, wanted: str) -> tuple[np.ndarray, str]:
    return provide_labels(wanted, read_cloud(path)[0], path)


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    """Points without a column that is taken for labels."""
    return written(tmp_path, "scan.csv", ["x,y,z,zone", *as_text(BOX, normals=False)])


def test_the_usual_column_is_taken_and_none_takes_none(tmp_path: Path) -> None:
    path = written(tmp_path, "a.ply", ply(BOX))
    labels, provider = labels_of(path, "auto")
    np.testing.assert_array_equal(labels, BOX.labels)
    assert provider == "file:a.ply:part"
    labels, provider = labels_of(path, "none")
    assert (labels == -1).all()
    assert provider == "none"


def test_a_column_is_taken_by_its_name(scan: Path) -> None:
    for wanted in ("zone", f"{scan}:zone", f"{scan}:Zone"):
        labels, _ = labels_of(scan, wanted)
        np.testing.assert_array_equal(labels, BOX.labels)


def test_colours_are_numbered_by_falling_number_of_points(tmp_path: Path) -> None:
    labels, _ = labels_of(written(tmp_path, "a.ply", ply(BOX)), "colour")
    larger = 4 if (BOX.labels == 4).sum() >= 300 else 9
    np.testing.assert_array_equal(labels, np.where(BOX.labels == larger, 0, 1))


def test_a_label_file_has_a_number_for_each_point(scan: Path, tmp_path: Path) -> None:
    some = np.where(np.arange(600) < 100, -1, BOX.labels)
    for path in (written(tmp_path, "own.npy", npy(some)), written(tmp_path, "own.txt", [str(i) for i in some])):
        np.testing.assert_array_equal(labels_of(scan, str(path))[0], some)
    shutil.copy(tmp_path / "own.npy", tmp_path / "scan.labels.npy")
    labels, provider = labels_of(scan, "auto")
    np.testing.assert_array_equal(labels, some)
    assert provider == "file:scan.labels.npy"


def test_columns_that_may_be_parts_are_suggested(scan: Path, caplog: pytest.LogCaptureFixture) -> None:
    assert (labels_of(scan, "auto")[0] == -1).all()
    assert "give labels=<column>, one of zone" in caplog.text


@pytest.mark.parametrize(
    ("wanted", "words"),
    [
        ("geometric", "labels=geometric cuts meshes, and .* is a point cloud"),
        ("brep", "labels=brep cuts meshes"),
        ("nothing", "no column or label file 'nothing': give labels=<column>, one of zone"),
        ("short.npy", "has 599 labels for 600 points: give one for each"),
        ("broken.npy", "holds 0.5: part ids are integers"),
        ("mesh.stl", "give one integer for each point in .npy"),
    ],
)
def test_labels_that_do_not_fit_are_one_line(scan: Path, tmp_path: Path, wanted: str, words: str) -> None:
    written(tmp_path, "short.npy", npy(BOX.labels[1:]))
    written(tmp_path, "broken.npy", npy(BOX.labels + 0.5 - BOX.labels))
    written(tmp_path, "mesh.stl", b"solid")
    given = str(tmp_path / wanted) if "." in wanted else wanted
    with pytest.raises(InputError, match=words) as caught:
        labels_of(scan, given)
    assert "\n" not in str(caught.value)
