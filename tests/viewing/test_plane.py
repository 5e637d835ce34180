"""The plane of a slice cuts the shape where most of its surface is seen."""

from itertools import product

import numpy as np
import pytest
import trimesh
from solids import as_trimesh, labelled

from jointsdf.shapes.builtin import BUILTINS
from jointsdf.values import BOX, LabelledMesh, Normalisation
from jointsdf.viewing import plane as module
from jointsdf.viewing.plane import AXES, Plane, choose_plane


def block(sides: tuple[float, float, float], middle: tuple[float, float, float] = (0, 0, 0)) -> trimesh.Trimesh:
    return trimesh.creation.box(sides).apply_translation(middle)


def pegs() -> LabelledMesh:
    """A plate of height 1 with 16 pegs on it, as high."""
    places = product((-1.5, -0.5, 0.5, 1.5), repeat=2)
    return labelled(
        trimesh.util.concatenate([block((4, 4, 1), (0, 0, 0.5)), *(block((0.6, 0.6, 1), (*p, 1.5)) for p in places)])
    )


def chosen(mesh: LabelledMesh, up: str = "z") -> Plane:
    middle, scale = mesh.vertices.mean(axis=0), np.ptp(mesh.vertices, axis=0).max() / 2
    return choose_plane(mesh, Normalisation(middle, float(scale)), up)


def length_at(mesh: LabelledMesh, normal: int, place: float) -> float:
    """Length of the outline, by trimesh's own joined section."""
    axis = np.eye(3)[normal]
    section = as_trimesh(mesh).section(plane_origin=place * axis, plane_normal=axis)
    return 0.0 if section is None else float(section.length)


@pytest.mark.parametrize(
    ("solid", "normal", "place"),
    [
        (block((4, 2, 1)), 2, 0.0),  # outlines 12, 10 and 6
        (block((4, 1, 2), (7, 8, 9)), 1, 8.0),
        (block((2e-4, 4, 2), (7.0004, 8, 9)), 0, 7.0004),  # a sheet
        (block((2, 2, 10), (0.25, 5, 5)), 0, 0.25),  # as long as normal to y
        (trimesh.creation.annulus(3, 4, 1, sections=96), 2, 0.0),  # two circles, not two rectangles
    ],
)
def test_it_cuts_the_longest_outline_through_the_middle(solid: trimesh.Trimesh, normal: int, place: float) -> None:
    plane = chosen(labelled(solid))
    assert plane.normal == normal
    assert plane.place == pytest.approx(place, abs=1e-3 * solid.extents[normal])


@pytest.mark.parametrize("name", sorted(BUILTINS)[::5])
def test_its_outline_is_among_the_longest(name: str) -> None:
    mesh = BUILTINS[name]()
    plane = chosen(mesh)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    others = [
        length_at(mesh, k, low[k] + (high - low)[k] * share) for k in range(3) for share in np.arange(0.07, 1, 0.12)
    ]
    found = length_at(mesh, plane.normal, plane.place)
    assert found > 0.6 * max(others)  # those along faces are the longer ones
    assert low[plane.normal] < plane.place < high[plane.normal]


def test_it_does_not_run_along_faces(monkeypatch: pytest.MonkeyPatch) -> None:
    """The pegs' middle is where they stand on the plate: the next plane above, through the pegs, is taken."""
    plane = chosen(pegs())
    assert (plane.normal, plane.place) == (2, pytest.approx(2 * 8.5 / 15, abs=1e-3))
    assert length_at(pegs(), 2, plane.place) == pytest.approx(16 * 2.4)
    monkeypatch.setattr(module, "BLOCKED", np.inf)
    assert chosen(pegs()).place == pytest.approx(1.0)


def test_a_gap_in_the_middle_is_not_chosen() -> None:
    two = labelled(trimesh.util.concatenate([block((1, 1, 1)), block((1, 1, 1), (9, 9, 9))]))
    plane = chosen(two)
    assert length_at(two, plane.normal, plane.place) == pytest.approx(4)


def test_a_large_mesh_is_judged_by_a_part_of_its_faces(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = chosen(BUILTINS["part_01"]())
    monkeypatch.setattr(module, "FACES", 1000)
    part = chosen(BUILTINS["part_01"]())
    assert (part.normal, part.place) == (whole.normal, whole.place)


@pytest.mark.parametrize(("scale", "move"), [(1e-3, 0.0), (1.0, 1e5), (1e4, -3e6)])
def test_it_is_the_same_in_other_units_and_places(scale: float, move: float) -> None:
    mesh = BUILTINS["part_01"]()
    moved = LabelledMesh(mesh.vertices * scale + move, mesh.faces, mesh.labels)
    here, there = chosen(mesh), chosen(moved)
    assert (there.normal, there.right, there.up) == (here.normal, here.right, here.up)
    extent = np.ptp(mesh.vertices, axis=0)[here.normal]
    assert (there.place - move) / scale == pytest.approx(here.place, abs=2e-3 * extent)


@pytest.mark.parametrize(("normal", "up", "axes"), [(0, "z", "yz"), (1, "z", "xz"), (2, "z", "xy"), (0, "y", "zy")])
def test_what_is_up_is_up_in_the_picture(normal: int, up: str, axes: str) -> None:
    plane = Plane.at(normal, 0.0, Normalisation(np.zeros(3), 1.0), up)
    assert AXES[plane.right] + AXES[plane.up] == axes


def test_the_raster_covers_the_training_box() -> None:
    frame = Normalisation(np.array([10.0, 20.0, 30.0]), 5.0)
    plane = Plane.at(1, 21.0, frame)
    assert (plane.low.tolist(), plane.side, plane.name) == ([4.5, 24.5], pytest.approx(11.0), "y = 21")
    expected = [[7.25, 21, 27.25], [12.75, 21, 27.25], [7.25, 21, 32.75], [12.75, 21, 32.75]]
    np.testing.assert_allclose(plane.raster(2), expected)
    inner = np.abs(frame.forward(plane.raster(50)))[:, [0, 2]]
    assert inner.max() == pytest.approx(BOX * (1 - 1 / 50))
