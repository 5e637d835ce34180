"""Sections in any direction: rasters, values and isolines of known distances."""

from collections.abc import Callable

import numpy as np
import pytest
from analytic import sphere_distance

from jointsdf.errors import InputError
from jointsdf.model.field import JointField
from jointsdf.values import BOX, Normalisation, Unit
from jointsdf.viewing.plane import Plane
from jointsdf.viewing.section import Section, isolines, parse_section, section_values
from jointsdf.viewing.section_picture import DPI, SIZE, draw_section

MIDDLE = np.array([100.0, -20.0, 3.5])
FRAME = Normalisation(MIDDLE, 10.0)
DIAGONAL = f"1,1,1,{MIDDLE.sum() + 1}"


def test_a_section_normal_to_an_axis_is_the_plane_of_the_other_pictures() -> None:
    section, plane = parse_section("y=-18", FRAME, "z"), Plane.at(1, -18.0, FRAME)
    np.testing.assert_allclose(section.raster(7), plane.raster(7))
    assert section.name == "y = -18"
    same = parse_section("0,2,0,-36", FRAME, "z")
    assert same.side == pytest.approx(section.side)
    np.testing.assert_allclose(same.raster(7)[:, 1], -18)
    assert np.abs(FRAME.forward(same.raster(50))).max() <= BOX


@pytest.mark.parametrize("normal", [(1, 1, 1), (0.2, -3, 0.5), (1, 0, 1), (0, 0, 1)])
def test_an_oblique_section_is_in_its_plane_and_holds_the_box_there(normal: tuple[float, ...]) -> None:
    d = float(MIDDLE @ normal) + 0.3
    section = parse_section(",".join(map(str, (*normal, d))), FRAME, "z")
    points = section.raster(60)
    np.testing.assert_allclose(points @ normal, d)
    assert section.right @ section.up == pytest.approx(0, abs=1e-12)
    assert section.up[2] >= 0
    inside = np.random.default_rng(0).uniform(-BOX, BOX, (2000, 3))
    on_plane = FRAME.inverse(inside)
    on_plane -= ((on_plane @ normal - d) / np.dot(normal, normal))[:, None] * np.array(normal)
    on_plane = on_plane[(np.abs(FRAME.forward(on_plane)) <= BOX).all(axis=1)]
    across, above = (on_plane - section.corner) @ section.right, (on_plane - section.corner) @ section.up
    assert min(across.min(), above.min()) >= -1e-9
    assert max(across.max(), above.max()) <= section.side + 1e-9


def test_isolines_of_a_ball_are_circles_in_the_plane() -> None:
    section = parse_section(DIAGONAL, FRAME, "z")
    values = sphere_distance(section.raster(300) - MIDDLE, 6.0).reshape(300, 300)
    lines = list(isolines(section, values, np.array([-2.0, 0.0, 1.5])))
    assert [line.level for line in lines] == [-2.0, 0.0, 1.5]
    for line in lines:
        assert line.is_closed
        np.testing.assert_allclose(line.points.sum(axis=1), MIDDLE.sum() + 1)
        np.testing.assert_allclose(np.linalg.norm(line.points - MIDDLE, axis=1), 6 + line.level, atol=1e-3)


def test_values_are_the_fields_and_unknown_outside_the_box(small_field: Callable[..., JointField]) -> None:
    field = small_field("siren", normalisation=FRAME).eval()
    section = parse_section(DIAGONAL, FRAME, "z")
    values, points = section_values(field, section, 40).ravel(), section.raster(40)
    within = (np.abs(FRAME.forward(points)) <= BOX).all(axis=1)
    assert 0.2 < within.mean() < 0.9
    np.testing.assert_array_equal(np.isfinite(values), within)
    np.testing.assert_allclose(values[within], field.query(points[within], what="sdf").sdf)


def test_the_picture_is_orange_inside_blue_outside_and_blank_beyond_the_box() -> None:
    section = Section.of_plane(Plane.at(2, 3.5, FRAME))
    values = sphere_distance(section.raster(100) - MIDDLE, 6.0).reshape(100, 100)
    values[:, :10] = np.nan
    picture = draw_section(section, values, np.arange(-6, 11, 2.0), Unit("cm", 0.01)).astype(int)
    assert picture.shape == (SIZE * DPI, SIZE * DPI, 3)
    red, _, blue = np.moveaxis(picture, -1, 0)
    assert (red - blue > 60).sum() > 10_000
    assert (blue - red > 20).sum() > 10_000


@pytest.mark.parametrize(
    "text", ["w=3", "z=far", "1,2,3", "0,0,0,1", "1,nan,0,2", "1,0,0,500", "z=90", "", "1,0,0,2,3", "a,b,c,d"]
)
def test_what_is_no_plane_is_one_line(text: str) -> None:
    with pytest.raises(InputError, match=r"^--plane [^\n]*$"):
        parse_section(text, FRAME, "z")
