"""The benchmark of creases against roundings of known radius."""

import csv
from pathlib import Path

import numpy as np
import pytest
import trimesh
from command_line import finished
from solids import labelled

from benchmarks import creases, sections
from jointsdf.geometry.distance import ExactDistance


def wedge(angle: float, radius: float, convex: bool) -> sections.Differential:
    """Two half planes whose normals are `angle` apart, bisector +y, rounded: the distance, exact near its zero."""
    half = angle / 2

    def ridge(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        at = points + np.array([0, radius / np.cos(half), 0])
        turn = np.clip(np.arctan2(at[:, 0], at[:, 1]), -half, half)
        normals = np.stack([np.sin(turn), np.cos(turn), np.zeros(len(at))], axis=1)
        return np.einsum("nd,nd->n", at, normals) - radius, normals

    def valley(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values, normals = ridge(points * [1, -1, 1])
        return -values, normals * [-1, 1, -1]

    return ridge if convex else valley


@pytest.mark.parametrize("convex", [True, False])
@pytest.mark.parametrize(("degrees", "radius"), [(45, 0.008), (90, 0.003), (90, 0.0004), (140, 0.001)])
def test_a_rounding_has_its_radius_and_its_gap(degrees: float, radius: float, convex: bool) -> None:
    angle = np.radians(degrees)
    field = wedge(angle, radius, convex)
    points = np.zeros((5, 3))
    points[:, 2] = np.linspace(-1, 1, 5)
    up, side = np.tile([0.0, 1, 0], (5, 1)), np.tile([1.0, 0, 0], (5, 1))
    gap = sections.gaps(lambda at: field(at)[0], points, up)
    np.testing.assert_allclose(gap, (-1 if convex else 1) * radius * (1 / np.cos(angle / 2) - 1), atol=1e-7)
    starts = points + gap[:, None] * up
    found = sections.radii(field, starts, up, side, np.full(5, angle), np.full(5, convex))
    np.testing.assert_allclose(found, radius, rtol=0.02, atol=sections.STEP / 2)
    other = sections.radii(field, starts, up, side, np.full(5, angle), np.full(5, not convex))
    assert np.isinf(other).all(), "it turns the other way"


def test_a_sharp_corner_has_no_radius_and_a_flat_field_no_turn() -> None:
    up, side, angle = np.array([[0.0, 1, 0]]), np.array([[1.0, 0, 0]]), np.array([np.pi / 2])
    sharp = sections.radii(wedge(np.pi / 2, 1e-9, True), np.zeros((1, 3)), up, side, angle, np.array([True]))
    assert sharp[0] <= 2 * sections.STEP

    def flat(at):
        return at[:, 1], np.tile([0.0, 1, 0], (len(at), 1))

    assert np.isinf(sections.radii(flat, np.zeros((1, 3)), up, side, angle, np.array([True])))
    assert np.isnan(sections.gaps(lambda at: at[:, 1] + 2 * sections.LOOKED, np.zeros((1, 3)), up))


def test_true_creases_of_a_solid_with_a_step() -> None:
    """Two boxes, one upon the other: concave where they meet; not clear are the points beside corners."""
    outline = np.array([[0, 0], [1, 0], [1, 0.3], [0.4, 0.3], [0.4, 0.7], [0, 0.7]])
    triangles = np.array([[0, 1, 3], [1, 2, 3], [0, 3, 4], [0, 4, 5]])
    mesh = labelled(trimesh.creation.extrude_triangulation(outline, triangles, 0.5))
    edges = creases.true_edges(mesh, ExactDistance(mesh, watertight=True).signed, 4000)
    np.testing.assert_allclose(edges.angles, np.pi / 2, atol=1e-9)
    concave = (np.abs(edges.points[:, :2] - [0.4, 0.3]) < 1e-9).all(axis=1)
    np.testing.assert_array_equal(edges.convex[edges.clear], ~concave[edges.clear])
    corners = np.concatenate([np.insert(outline, 2, z, axis=1) for z in (0, 0.5)])
    apart = np.linalg.norm(edges.points[:, None] - corners, axis=2).min(axis=1)
    assert edges.clear[apart > 0.01].all()
    assert not edges.clear[apart < 0.3 * creases.CLEAR].any()


def test_the_command_measures_a_finished_run_and_appends_its_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(creases, "RESULTS", tmp_path / "creases.csv")
    monkeypatch.setattr(creases, "POINTS", 60)
    monkeypatch.setattr(sections, "STEP", 0.001)
    folder = finished()
    creases.main([str(folder), "--write"])
    with (tmp_path / "creases.csv").open() as file:
        found = list(csv.DictReader(file))
    assert {row["shape"] for row in found} == {"part_01", "all"}
    assert found[0]["command"] == f"python -m benchmarks.creases {folder} --write"
    assert len(capsys.readouterr().out.splitlines()) == len(found) + 1


def test_percentiles_leave_out_what_is_missing_and_keep_what_is_beyond() -> None:
    angles, convex = np.full(40, 90.0), np.ones(40, dtype=bool)
    gap, radius = np.linspace(0, 39, 40), np.where(np.arange(40) < 10, np.inf, 1.0)
    gap[:4], radius[:4] = np.nan, np.nan
    found = creases.Rounding(gap, radius, np.full(40, 2.0), angles, convex, 0.5, 1.0)
    (row,) = creases.classes("solid", creases.pooled([found, found]))
    assert row["points"] == 80
    assert row["missing"] == 0.1
    assert (row["gap_50"], row["gap_cells_50"], row["radius_50"], row["radius_95"]) == (22.0, 11.0, 1.0, np.inf)


def test_a_ball_has_no_crease() -> None:
    mesh = labelled(trimesh.creation.icosphere(4, 0.5))
    edges = creases.true_edges(mesh, ExactDistance(mesh, watertight=True).signed, 50)
    assert len(edges.points) == len(edges.clear) == 0
    field = wedge(1.0, 0.001, True)
    assert len(sections.gaps(lambda at: field(at)[0], edges.points, edges.bisectors)) == 0
    assert len(sections.radii(field, edges.points, edges.bisectors, edges.across, edges.angles, edges.convex)) == 0
