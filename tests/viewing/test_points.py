"""Pictures of points: their colours where they lie, the nearer ones over the others."""

from dataclasses import replace

import numpy as np
from cloud_files import COLOURS, colours_of, on_box
from solids import halves

from jointsdf.shapes.clouds.sources import load_cloud
from jointsdf.values import Scan, Shape
from jointsdf.viewing.palette import part_colours
from jointsdf.viewing.points import beside_fit, draw_points, what_is_given
from jointsdf.viewing.raycast import Camera

BOX = on_box(3000)
CAMERA = Camera(np.array([[1.0, 0, 0], [0, 0, 1], [0, 1, 0]]), np.array([0.5, 0, 0]), 0.05, 100, 60)  # along +y


def scan(labels: np.ndarray | None = BOX.labels) -> Scan:
    return load_cloud(points=BOX.points, labels=labels, name="scan")


def hues(picture: np.ndarray) -> np.ndarray:
    """Channel of most light of each coloured pixel."""
    drawn = picture[(picture != 255).any(axis=-1)]
    return drawn / np.maximum(drawn.max(axis=1, keepdims=True), 1)


def test_points_have_the_colour_of_their_part_on_their_side() -> None:
    picture = draw_points(scan(), CAMERA)
    for part, columns in ((9, slice(12, 48)), (4, slice(52, 88))):
        colour = part_colours(np.array([part]))[0].astype(float)
        np.testing.assert_allclose(hues(picture[15:45, columns]) - colour / colour.max(), 0, atol=0.02)
    assert (picture[:, :8] == 255).all()
    assert (picture[:8] == 255).all()
    assert (picture[12:48, 12:88] != 255).any(axis=-1).mean() > 0.95, "points are as large as they are sparse"


def test_the_nearer_points_are_seen() -> None:
    dense = on_box(20000)
    sides = load_cloud(points=dense.points, labels=np.where(dense.points[:, 1] < 0, 4, 9), name="scan")
    near = part_colours(np.array([4]))[0].astype(float)
    inner = hues(draw_points(sides, CAMERA)[15:45, 15:85])
    assert (np.abs(inner - near / near.max()).max(axis=1) < 0.02).mean() > 0.95


def test_without_labels_points_have_their_own_colours() -> None:
    coloured = replace(scan(None), colours=colours_of(BOX))
    left = hues(draw_points(coloured, CAMERA)[15:45, 12:48])
    np.testing.assert_allclose(left - COLOURS[1] / 240, 0, atol=0.02)


def test_a_fit_is_drawn_beside_points_or_beside_the_truth() -> None:
    bare = scan()
    scored = replace(bare, truth=Shape("halves", halves(), "0" * 64, "file", True))
    pictures = [beside_fit(shape)(halves(), captions=("a", "b"), width=160, height=120) for shape in (bare, scored)]
    assert pictures[0].shape == pictures[1].shape
    np.testing.assert_array_equal(pictures[0][:, 160:].shape, pictures[1][:, 160:].shape)
    assert (pictures[0][:120, :160] != pictures[1][:120, :160]).any()
    assert [what_is_given(shape) for shape in (bare, scored)] == ["points", "ground truth"]
