"""Labels per triangle, polygon, vertex and B-rep face."""

import numpy as np
import pytest

from jointsdf.errors import InputError
from jointsdf.shapes.labels.lengths import spread_labels
from jointsdf.shapes.readers.file_mesh import FileMesh

PYRAMID = np.array([[0, 1, 2], [0, 2, 3], [0, 4, 1], [1, 4, 2], [2, 4, 3], [3, 4, 0]])  # on a square, cut in two
SQUARE_FIRST = np.array([0, 0, 1, 2, 3, 4])
TENT = np.concatenate([PYRAMID, [[0, 1, 5]]])  # an odd face at a sixth vertex


def mesh(faces: np.ndarray, polygons: np.ndarray | None = None, vertices: int = 5) -> FileMesh:
    return FileMesh(np.eye(vertices, 3), faces, polygons=polygons)


def test_the_count_says_what_is_labelled() -> None:
    polygons = np.array([0, 0, 1, 2, 3, 4, 5])
    tent = mesh(TENT, polygons, vertices=8)
    assert spread_labels("it", np.arange(7) * 10, tent).tolist() == [0, 10, 20, 30, 40, 50, 60]
    assert spread_labels("it", np.array([9, 8, 7, 6, 5, 4]), tent).tolist() == [9, 9, 8, 7, 6, 5, 4]
    of_vertices = np.array([3, 3, 1, 2, 2, 7, 0, 0])
    assert spread_labels("it", of_vertices, tent).tolist() == [3, 3, 3, 3, 2, 2, 3], "the majority, or the first corner"


def test_brep_faces_of_a_step_file() -> None:
    patches = np.array([2, 2, 0, 1, 1, 0])
    assert spread_labels("it", np.array([30, 40, 50]), mesh(PYRAMID), patches).tolist() == [50, 50, 30, 40, 40, 30]


def test_of_several_readings_the_first_is_taken_and_said(caplog: pytest.LogCaptureFixture) -> None:
    pyramid = mesh(PYRAMID, SQUARE_FIRST)  # five polygons, five vertices
    labels = np.array([4, 5, 6, 7, 8])
    assert spread_labels("it", labels, pyramid).tolist() == labels[SQUARE_FIRST].tolist()
    assert "it: its 5 labels fit polygons and vertices: read as of polygons" in caplog.text
    caplog.clear()
    plain, patches = mesh(PYRAMID), np.array([5, 4, 3, 2, 1, 0])
    assert spread_labels("it", np.arange(6), plain, patches).tolist() == [0, 1, 2, 3, 4, 5]
    assert spread_labels("it", np.arange(6), plain, patches, patches_first=True).tolist() == [5, 4, 3, 2, 1, 0]
    assert "fit B-rep faces and triangles: read as of B-rep faces" in caplog.text


@pytest.mark.parametrize(
    ("polygons", "patches", "counts"),
    [
        (None, None, "6 faces, 5 vertices"),
        (np.array([0, 0, 1, 2, 3, 3]), None, "6 triangles, 4 polygons, 5 vertices"),
        (None, np.array([0, 0, 1, 1, 2, 2]), "6 triangles, 5 vertices, 3 B-rep faces"),
    ],
)
def test_another_count_is_refused_with_those_that_fit(
    polygons: np.ndarray | None, patches: np.ndarray | None, counts: str
) -> None:
    with pytest.raises(InputError, match=f"it has 7 labels, the mesh has {counts}: give one label for each"):
        spread_labels("it", np.arange(7), mesh(PYRAMID, polygons), patches)
