"""The picture of a slice: round levels, the same in both panels, and colours that tell inside from outside."""

from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest
from analytic import sphere_distance
from matplotlib.axes import Axes
from matplotlib.contour import QuadContourSet

from jointsdf.values import Normalisation, Unit
from jointsdf.viewing.isolines import (
    HEIGHT,
    INSIDE,
    OUTSIDE,
    WIDTH,
    band_colours,
    draw_slice,
    isoline_levels,
    isoline_step,
    slice_figure,
)
from jointsdf.viewing.plane import Plane, Slice

PLANE = Plane.at(2, 0.0, Normalisation(np.array([100.0, 0.0, 0.0]), 10.0))
POINTS = PLANE.raster(80) - [100.0, 0.0, 0.0]
BALL = sphere_distance(POINTS, 6.0).reshape(80, 80)
FOUND = Slice(PLANE, BALL, BALL + 0.012, 12.0, Unit("cm", 0.01))


def contours(panel: Axes) -> list[QuadContourSet]:
    return [found for found in panel.get_children() if isinstance(found, QuadContourSet)]


@pytest.mark.parametrize("depth", [0.0, 0.001, 0.02, 0.3, 1.0])
def test_levels_are_round_and_neither_few_nor_many(depth: float) -> None:
    for size in 10.0 ** np.linspace(-5, 5, 61):
        distances = np.array([[-depth * size, size]])
        step = isoline_step(distances)
        digit = step / 10.0 ** np.floor(np.log10(step * (1 + 1e-9)))
        assert min(abs(digit - round_digit) for round_digit in (1, 2, 5)) < 1e-9
        levels = isoline_levels(distances, step)
        assert 7 <= len(levels) - 1 <= 31
        assert 0.0 in levels
        assert levels[0] <= -depth * size <= levels[1]
        assert levels[-2] <= size <= levels[-1]
        np.testing.assert_allclose(np.diff(levels), step)


def test_a_deep_inside_has_several_bands() -> None:
    assert isoline_step(np.array([[-6.0, 50.0]])) == 2.0
    assert isoline_step(np.array([[-60.0, 50.0]])) == 10.0


def test_inside_and_outside_differ_with_any_colour_vision() -> None:
    """Orange and blue, on either side of the yellow-blue axis, which those who confuse red and green keep."""
    for colormap, sign in ((INSIDE, 1), (OUTSIDE, -1)):
        red, green, blue, _ = np.array([colormap(share) for share in np.linspace(0, 1, 20)]).T
        assert (sign * ((red + green) / 2 - blue) > 0.02).all()
        assert (np.diff(0.21 * red + 0.72 * green + 0.07 * blue) < 0).all()  # the darker the farther


def test_each_band_has_its_own_colour() -> None:
    bands = band_colours(np.array([-2.0, -1.0, 0.0, 1.0, 2.0, 3.0]))
    colours = bands.to_rgba(np.array([-9.0, -1.5, -0.5, 0.5, 1.5, 2.5, 9.0]))[:, :3]
    assert len(np.unique(colours, axis=0)) == 5
    np.testing.assert_array_equal(colours[[0, -1]], colours[[1, -2]])  # beyond the last levels
    assert (colours[:3, 0] > colours[:3, 2]).all()
    assert (colours[3:, 0] < colours[3:, 2]).all()
    light = colours.sum(axis=1)
    assert light[1] < light[2]
    assert light[3] > light[4] > light[5]


def test_panels_and_scales() -> None:
    figure = slice_figure(FOUND, "fast, head siren")
    truth, fit, error, distances, errors = figure.axes
    assert [panel.get_title() for panel in (truth, fit, error)] == [
        "ground truth at z = 0 cm",
        "fast, head siren",
        "error",
    ]
    assert (truth.get_xlabel(), truth.get_ylabel(), error.get_xlabel()) == ("x (cm)", "y (cm)", "x (cm)")
    assert distances.get_xlabel() == "signed distance, negative inside; isolines every 1 cm"
    assert errors.get_xlabel() == "|fit - truth| as a share of the longest side"
    assert [tick.get_text() for tick in errors.get_xticklabels()] == ["0.001%", "0.01%", "0.1%", "1%", "10%"]
    assert 0.0 in distances.get_xticks()
    for panel in (truth, fit, error):
        assert panel.get_xlim() == pytest.approx((89, 111), abs=0.2)
        assert panel.get_ylim() == pytest.approx((-11, 11), abs=0.2)
        box = panel.get_position()
        assert box.width * WIDTH == pytest.approx(box.height * HEIGHT)
    filled, lines, surface = contours(truth)
    for one, other in zip(contours(truth), contours(fit), strict=True):
        np.testing.assert_array_equal(one.levels, other.levels)
        np.testing.assert_array_equal(one.get_facecolor(), other.get_facecolor())
    assert surface.levels.tolist() == [0.0]
    assert min(surface.get_linewidth()) >= 3 * max(lines.get_linewidth())
    assert set(np.abs(lines.levels)) <= set(np.abs(filled.levels)) - {0.0}


def test_the_thick_line_is_the_surface() -> None:
    truth, fit, error, *_ = slice_figure(replace(FOUND, fit=BALL + 1.0), "fit").axes
    for panel, radius in ((truth, 6.0), (fit, 5.0), (error, 6.0)):
        (line,) = contours(panel)[-1].get_paths()
        np.testing.assert_allclose(np.hypot(*(line.vertices - [100.0, 0.0]).T), radius, atol=0.01)


def test_the_error_is_a_share_of_the_longest_side() -> None:
    """0.012 of 12 is 0.1%: the band between 0.1% and 0.2%, everywhere."""
    (heat, _) = contours(slice_figure(replace(FOUND, fit=BALL + 0.0121), "fit").axes[2])
    filled = [low for low, path in zip(heat.levels, heat.get_paths(), strict=False) if len(path.vertices)]
    assert filled == [pytest.approx(1e-3)]


@pytest.mark.parametrize("fit", [BALL, np.abs(BALL) + 0.1, -np.abs(BALL) - 50.0, np.full_like(BALL, np.nan)])
def test_a_field_without_a_surface_is_drawn(fit: np.ndarray) -> None:
    panel = slice_figure(replace(FOUND, fit=fit), "fit").axes[1]
    assert (contours(panel)[-1].levels.tolist() == [0.0]) == (fit is BALL)
    assert draw_slice(replace(FOUND, fit=fit), width=320).std() > 10


def test_pixels_and_size() -> None:
    picture = draw_slice(FOUND)
    assert picture.shape == (HEIGHT, WIDTH, 3)
    assert draw_slice(FOUND, width=WIDTH // 2).shape == (HEIGHT // 2, WIDTH // 2, 3)
    figure = slice_figure(FOUND, "fit")
    bands = band_colours(isoline_levels(BALL, 1.0))
    for panel in figure.axes[:2]:
        for x, y in [(100.0, 0.4), (103.0, 1.5), (108.4, 0.0), (92.0, -9.4)]:
            share = panel.transAxes.inverted().transform(panel.transData.transform((x, y)))
            box = panel.get_position()
            column, row = box.x0 + share[0] * box.width, 1 - box.y0 - share[1] * box.height
            expected = bands.to_rgba(np.hypot(x - 100, y) - 6.0, bytes=True)[:3]
            shown = picture[int(row * HEIGHT), int(column * WIDTH)].astype(int)
            assert np.abs(shown - expected).max() <= 2, (x, y)


def test_the_picture_is_the_same_each_time_whatever_the_settings() -> None:
    first = draw_slice(FOUND, width=320)
    with mpl.rc_context({"font.size": 30, "axes.facecolor": "red", "axes.grid": True}):
        np.testing.assert_array_equal(draw_slice(FOUND, width=320), first)
        assert mpl.rcParams["font.size"] == 30
