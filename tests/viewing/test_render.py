"""Pictures pixel by pixel against what is known of the scene."""

from pathlib import Path

import numpy as np
import pytest
from labelled_meshes import EMPTY, box, by_side, sphere
from PIL import Image

from jointsdf.values import LabelledMesh
from jointsdf.viewing.palette import part_colours
from jointsdf.viewing.raycast import cast_rays, fit_camera
from jointsdf.viewing.render import render, render_comparison, write_png


def test_each_side_of_a_cube_shows_its_own_colour() -> None:
    mesh = box(by_side)
    for azimuth, label in [(0.0, 1), (90.0, 11), (180.0, 0), (270.0, 10)]:
        middle = render(mesh, width=64, height=64, azimuth=azimuth, elevation=0.0)[32, 32].astype(float)
        hue, expected = middle / middle.sum(), part_colours(np.array([label]))[0].astype(float)
        np.testing.assert_allclose(hue, expected / expected.sum(), atol=0.02)
    top = render(mesh, width=64, height=64, azimuth=0.0, elevation=60.0)
    visible = cast_rays(mesh, fit_camera(mesh, 64, 64, azimuth=0.0, elevation=60.0))
    assert set(mesh.labels[np.unique(visible.faces[visible.seen])].tolist()) == {1, 21}
    assert (top[0, 0] == 255).all()


def test_lines_lie_on_part_borders_creases_and_the_outline() -> None:
    ball = sphere(1.0)
    picture = render(ball, width=200, height=200, azimuth=0.0, elevation=0.0).astype(int).sum(axis=2)
    column = picture[:, 100]
    assert column[98:103].min() < 300  # the border between the halves, through the middle
    radius = round(100 / 1.06)
    assert column[100 - radius - 2 : 100 - radius + 3].min() < 300  # the outline
    assert column[20:95].min() > 300
    one_part = box(lambda normals: np.zeros(len(normals), dtype=np.int64))
    cube = render(one_part, width=200, height=200, azimuth=45.0, elevation=0.0).astype(int).sum(axis=2)
    flat = np.median(cube[100, 60:90])
    assert cube[100, 98:103].min() < 0.85 * flat
    assert np.ptp(cube[100, 45:90]) <= 3


def test_picture_is_the_same_each_time_and_in_other_units() -> None:
    mesh = box(by_side)
    first = render(mesh, width=80, height=60)
    np.testing.assert_array_equal(first, render(mesh, width=80, height=60))
    moved = LabelledMesh(mesh.vertices * 1000 + [5e4, -2e4, 7e3], mesh.faces, mesh.labels)
    other = render(moved, width=80, height=60)
    assert (np.abs(first.astype(int) - other).max(axis=2) > 8).mean() < 0.01


def test_comparison_keeps_the_scale_of_the_ground_truth() -> None:
    truth, half = box(by_side), box(by_side, size=0.5)
    picture = render_comparison(truth, half, width=120, height=90)
    assert picture.shape == (90 + 24, 240, 3)
    left, right = (picture[:90, :120] < 250).any(axis=2), (picture[:90, 120:] < 250).any(axis=2)
    assert right.sum() / left.sum() == pytest.approx(0.25, abs=0.03)
    np.testing.assert_array_equal(picture[:90, :120], render(truth, width=120, height=90))
    assert (picture[90:, :120] < 100).any()
    assert (picture[90:, 120:] < 100).any()


def test_an_empty_prediction_says_so() -> None:
    blank = render(EMPTY, width=120, height=90)
    assert blank.shape == (90, 120, 3)
    assert 0 < (blank < 128).any(axis=2).mean() < 0.2
    assert (blank[:20] == 255).all()
    np.testing.assert_array_equal(render_comparison(box(by_side), EMPTY, width=120, height=90)[:90, 120:], blank)
    assert render_comparison(EMPTY, box(by_side), width=120, height=90).shape == (114, 240, 3)


def test_png_round_trip(tmp_path: Path) -> None:
    picture = render(box(by_side), width=40, height=30)
    write_png(tmp_path / "a.png", picture)
    np.testing.assert_array_equal(np.array(Image.open(tmp_path / "a.png")), picture)
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]
