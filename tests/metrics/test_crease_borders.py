"""Borders of parts on the edges of a cube, drawn too low, left out or on a smooth surface."""

import math

import numpy as np
import pytest
import trimesh
from labelled_meshes import EMPTY
from surface_samples import cube, plate, score

from jointsdf.errors import InputError
from jointsdf.metrics.crease_borders import COLUMNS, CreaseBorders
from jointsdf.values import LabelledMesh

SOLID = cube()
SIDES = 2 * np.abs(SOLID.vertices[SOLID.faces].sum(axis=1)).argmax(axis=1)
SIDES += np.take_along_axis(SOLID.vertices[SOLID.faces].sum(axis=1), SIDES[:, None] // 2, 1)[:, 0] > 0


def layered(height: float, labels: tuple[int, int, int]) -> LabelledMesh:
    """A cube with labels of its lower faces, of those of its sides above a height, and of its top."""
    box = trimesh.creation.box((1, 1, 1)).subdivide()
    vertices = np.array(box.vertices)
    vertices[vertices[:, 2] == 0, 2] = height
    faces = np.array(box.faces)
    highest, lowest = vertices[faces][:, :, 2].max(axis=1), vertices[faces][:, :, 2].min(axis=1)
    return LabelledMesh(vertices, faces, np.select([lowest == 0.5, highest == 0.5], [labels[2], labels[1]], labels[0]))


def borders(predicted: LabelledMesh, truth: LabelledMesh) -> tuple[float, ...]:
    found = score(CreaseBorders(), predicted, truth, count=10)
    assert found.keys() == set(COLUMNS)
    return tuple(found[column] for column in COLUMNS)


@pytest.mark.parametrize("drop", [0.0005, 0.02])
def test_a_border_below_its_edge_is_the_drop_away(drop: float) -> None:
    assert borders(layered(0.5 - drop, (0, 1, 1)), layered(0, (0, 0, 1))) == pytest.approx((drop, drop), rel=1e-6)


def test_a_missing_part_is_seen_in_the_way_back_alone() -> None:
    """Two sides that meet become one: what was the border between them is up to 0.5 from the next."""
    merged = cube(labels=np.where(SIDES < 4, SIDES, 4))  # the sides of +z and -z do not meet: their edges stay
    assert borders(merged, cube(labels=SIDES)) == pytest.approx((0, 0), abs=1e-9)
    merged = cube(labels=np.where(SIDES == 2, 0, SIDES))
    forth, back = borders(merged, cube(labels=SIDES))
    assert forth == pytest.approx(0, abs=1e-9)
    assert back == pytest.approx(0.44, abs=0.01)  # 0.99 of all edges, 12 of them: 0.06 from its middle


def test_borders_on_smooth_surface_do_not_count() -> None:
    """The truth's border runs along an edge and across the sides; the second one is displaced."""
    assert borders(layered(0.03, (0, 1, 2)), layered(0, (0, 1, 2))) == pytest.approx((0, 0), abs=1e-9)


def test_nothing_to_compare_is_nan() -> None:
    flat, unlabelled, one = plate(lambda _: 0.5), cube(labels=np.full(12, -1)), cube(labels=np.zeros(12, int))
    sides = cube(labels=SIDES)
    for pair in ((flat, flat), (sides, unlabelled), (unlabelled, sides), (one, sides), (sides, one), (EMPTY, sides)):
        assert all(math.isnan(value) for value in borders(*pair))
    with pytest.raises(InputError, match="spacing"):
        CreaseBorders(0.0)
