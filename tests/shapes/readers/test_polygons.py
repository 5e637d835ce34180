"""Triangulation of polygons against their area by Newell's formula."""

import logging
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jointsdf.geometry.topology import signed_volume
from jointsdf.shapes.readers.polygons import triangulate
from jointsdf.shapes.repair import repair_mesh

L = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 3], [0, 3.0]])
STAR = np.array([[np.cos(t) * r, np.sin(t) * r] for t, r in zip(np.arange(10) * np.pi / 5, [3, 1] * 5, strict=True)])
COLLINEAR = np.array([[0, 0], [1, 0], [2, 0], [3, 0], [3, 3], [0, 3.0]])
COMB = np.array([[0, 0], [5, 0], [5, 3], [4, 3], [4, 1], [3, 1], [3, 3], [2, 3], [2, 1], [1, 1], [1, 3], [0, 3.0]])
KEYHOLE = np.array([[0, 0], [4, 0], [4, 4], [0, 4], [0, 0], [1, 1], [1, 3], [3, 3], [3, 1], [1, 1.0]])
AREAS = {"l": (L, 4.0), "star": (STAR, 15 * np.sin(np.pi / 5)), "collinear": (COLLINEAR, 9.0), "comb": (COMB, 11.0),
         "keyhole": (KEYHOLE, 12.0)}  # fmt: skip
TILT = np.linalg.qr(np.array([[1, 2, 3], [0, 1, 4], [5, 6, 0.0]]))[0]


def lift(flat: np.ndarray) -> np.ndarray:
    """In a tilted plane off the origin, to float32's digits."""
    return (np.column_stack([flat, np.zeros(len(flat))]) @ TILT + [0.7, -0.3, 1.1]).astype(np.float32).astype(float)


def doubled_areas(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = vertices[faces].transpose(1, 0, 2)
    return np.cross(b - a, c - a)


def check_cut(vertices: np.ndarray) -> None:
    """All corners are used, each triangle faces as the polygon does, has an area, and the areas add up."""
    count = len(vertices)
    faces, polygons = triangulate(vertices, np.arange(count), np.array([count]))
    assert faces.shape == (count - 2, 3)
    assert polygons is not None
    assert set(faces.ravel()) == set(range(count))
    centred = vertices - vertices[0]
    newell = np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0)
    along = doubled_areas(vertices, faces) @ newell / np.linalg.norm(newell)
    assert along.min() > 1e-6 * along.max()
    assert along.sum() == pytest.approx(np.linalg.norm(newell), rel=1e-6)
    edges = {edge for face in faces.tolist() for edge in pairwise([*face, face[0]])}
    inner = {(b, a) for a, b in edges} & edges
    assert edges - inner == {(i, (i + 1) % count) for i in range(count)}, "the outline is the polygon's"


@pytest.mark.parametrize("name", AREAS)
@pytest.mark.parametrize("way", [1, -1])
def test_every_start_and_orientation_gives_the_area(name: str, way: int) -> None:
    flat, area = AREAS[name]
    for start in range(len(flat)):
        vertices = lift(np.roll(flat, start, axis=0)[::way])
        check_cut(vertices)
        faces, _ = triangulate(vertices, np.arange(len(flat)), np.array([len(flat)]))
        assert np.linalg.norm(doubled_areas(vertices, faces), axis=1).sum() / 2 == pytest.approx(area, rel=1e-6)


@settings(max_examples=60, deadline=None, database=None)
@given(st.integers(0, 2**32 - 1), st.integers(4, 14), st.booleans())
def test_random_simple_polygons(seed: int, count: int, halved: bool) -> None:
    rng = np.random.default_rng(seed)
    angles = (np.arange(count) + rng.uniform(0.1, 0.9, count)) * 2 * np.pi / count
    flat = rng.uniform(0.2, 1, (count, 1)) * np.column_stack([np.cos(angles), np.sin(angles)])
    if halved:  # corners amid the edges
        flat = np.stack([flat, (flat + np.roll(flat, -1, axis=0)) / 2], axis=1).reshape(-1, 2)
    check_cut(lift(flat))


def test_convex_polygons_stay_fans_whether_flat_or_not() -> None:
    turn = np.arange(9) * 2 * np.pi / 9
    saddle = np.array([[0, 0, 0], [1, 0, 0.3], [1, 1, 0], [0, 1, 0.3]])
    vertices = np.concatenate([np.column_stack([np.cos(turn), np.sin(turn), 0 * turn]), saddle])
    faces, polygons = triangulate(vertices, np.arange(13), np.array([9, 4]))
    assert faces.tolist() == [[0, i, i + 1] for i in range(1, 8)] + [[9, 10, 11], [9, 11, 12]]
    assert polygons is not None
    assert polygons.tolist() == [0] * 7 + [1] * 2


def test_triangles_pass_as_they_are_and_polygons_keep_their_order() -> None:
    vertices = np.concatenate([lift(L), lift(COMB) + 9, lift(COLLINEAR) - 9])
    corners = np.concatenate([[0, 1, 2], np.arange(6, 18), [3, 4, 5], np.arange(18, 24), [0, 1, 3, 5]])
    faces, polygons = triangulate(vertices, corners, np.array([3, 12, 3, 6, 4]))
    assert polygons is not None
    assert polygons.tolist() == [0] + [1] * 10 + [2] + [3] * 4 + [4] * 2
    assert faces[[0, 11]].tolist() == [[0, 1, 2], [3, 4, 5]]
    assert [set(faces[polygons == each].ravel()) for each in (1, 3)] == [set(range(6, 18)), set(range(18, 24))]
    only, none = triangulate(vertices, corners[[0, 1, 2, 15, 16, 17]], np.array([3, 3]))
    assert (only.tolist(), none) == ([[0, 1, 2], [3, 4, 5]], None)


@pytest.mark.parametrize(("name", "volume"), [("l", 12.0), ("collinear", 27.0), ("comb", 33.0), ("keyhole", 36.0)])
def test_prisms_close(name: str, volume: float, caplog: pytest.LogCaptureFixture) -> None:
    flat = AREAS[name][0]
    _, index = np.unique(flat, axis=0, return_inverse=True)
    bottom = index.reshape(-1)
    count = bottom.max() + 1
    positions = np.zeros((count, 2))
    positions[bottom] = flat
    vertices = np.column_stack([np.tile(positions, (2, 1)), np.repeat([0.0, 3.0], count)])
    outline = [(a, b) for a, b in pairwise([*bottom.tolist(), bottom[0]])]
    walls = [[a, b, b + count, a + count] for a, b in outline if (b, a) not in outline]
    corners = np.concatenate([bottom[::-1], bottom + count, np.ravel(walls)])
    sizes = np.array([len(flat)] * 2 + [4] * len(walls))
    faces, _ = triangulate(vertices, corners, sizes)
    solid = repair_mesh("prism", vertices, faces)
    assert solid.watertight
    assert signed_volume(solid.vertices, solid.faces) == pytest.approx(volume)
    assert not any("degenerate" in record.message for record in caplog.records)


@pytest.mark.parametrize("flat", [[[0, 0], [2, 2], [2, 0], [0, 2]], [[0, 0], [3, 3], [3, 0], [0, 1]]])
def test_a_polygon_that_crosses_itself_is_warned_of(flat: list[list[float]], caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        faces, _ = triangulate(lift(np.array(flat, dtype=float)), np.arange(4), np.array([4]), "a.obj")
    assert faces.shape == (2, 3)
    assert "a.obj: 1 of 1 polygons cross themselves" in caplog.text


@pytest.mark.parametrize("flat", [[[0, 0], [1, 0], [1, 1], [1, 1]], [[0, 0], [1, 0], [2, 0], [3, 0]]])
def test_doubled_corners_and_polygons_without_area_are_cut_silently(
    flat: list, caplog: pytest.LogCaptureFixture
) -> None:
    faces, _ = triangulate(lift(np.array(flat, dtype=float)), np.arange(4), np.array([4]))
    assert faces.shape == (2, 3)
    assert set(faces.ravel()) == {0, 1, 2, 3}
    assert not caplog.records


@pytest.mark.parametrize("bad", [np.nan, np.inf, 9])
def test_what_is_refused_later_is_left_as_fans(bad: float) -> None:
    vertices, corners = lift(L), np.arange(6)
    if bad == 9:
        corners[3] = 9
    else:
        vertices[3, 1] = bad
    faces, _ = triangulate(vertices, corners, np.array([6]))
    assert faces.tolist() == [[corners[0], corners[i], corners[i + 1]] for i in range(1, 5)]


@pytest.mark.parametrize("size", [1e-150, 1e-6, 1e9, 1e300])
def test_the_scale_does_not_matter(size: float) -> None:
    right, _ = triangulate(lift(L), np.arange(6), np.array([6]))
    faces, _ = triangulate(lift(L) * size, np.arange(6), np.array([6]))
    np.testing.assert_array_equal(faces, right)
