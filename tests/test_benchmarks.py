"""The benchmarks at tiny sizes: both sides compute the same, and the table says so."""

import csv
import os
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh

from benchmarks import __main__ as command
from benchmarks import (
    extraction,
    fit,
    grids,
    limits,
    measures,
    overhead,
    parts,
    progress,
    quality,
    queries,
    representations,
    signs,
    simplification,
    step,
    tracing,
)
from benchmarks.scene import composed
from benchmarks.table import Row, interleaved, table
from jointsdf.evaluation.protocol import GroundTruth, Protocol
from jointsdf.experiment.run import run
from jointsdf.geometry.distance import ExactDistance
from jointsdf.metrics.surface_distance import SurfaceDistance
from jointsdf.optimizers import ITERATIONS, orthogonalise
from jointsdf.values import LabelledMesh

SMALL = ("data.pool_size=2000", "data.cloud_size=2000", "data.border_points=2000", "extraction.resolution=24")
COUNTS = [f"data.counts.{name}=50" for name in ("manifold", "non_manifold", "shell", "pool")]


@pytest.fixture(scope="module")
def prepared():
    module, samples = step.prepared(60)
    module = module.double()
    return module, type(samples)(*(part.double() if part.is_floating_point() else part for part in samples))


@pytest.mark.parametrize("odw", [True, False])
def test_both_formulations_have_the_same_gradient(prepared, odw):
    module, samples = prepared
    weights = step.weights_of(module, odw=odw)
    assert weights.keys() == {"dirichlet", "sign_agnostic", "eikonal", "weingarten"}
    assert (weights["weingarten"] > 0) == odw
    assert step.gradient_error(module, samples, weights) < 1e-10


def test_the_curvature_term_is_in_both(prepared):
    module, samples = prepared
    on, off = (step.weights_of(module, odw=odw) for odw in (True, False))
    for loss in (step.our_loss, step.released_loss):
        assert loss(module, samples, on).item() > loss(module, samples, off).item() > 0


def test_a_row_of_every_step_and_a_summary(tmp_path: Path):
    rows = step.rows(sizes=(40,), repetitions=1)
    assert [row.what.rpartition(", ")[2] for row in rows] == ["with ODW"] * 4 + ["without ODW"] * 4
    assert all(np.isfinite(row.ratio) and row.ratio > 0 for row in rows)
    command.write(tmp_path / "results.csv", rows, "python -m benchmarks step")
    command.write(tmp_path / "results.csv", rows, "python -m benchmarks step")
    with (tmp_path / "results.csv").open() as file:
        written = list(csv.DictReader(file))
    assert len(written) == 16
    assert {row["command"] for row in written} == {"python -m benchmarks step"}
    assert all(row["kind"].endswith(f"{os.cpu_count()} cores") and row["kind"].count(", ") == 2 for row in written)


def test_the_fit_and_the_limits_give_rows_and_claim_nothing_of_smaller_ones(monkeypatch):
    monkeypatch.setattr(fit, "smoke_seconds", lambda: (0.5, 9.0))
    rows = fit.rows(steps=8, repetitions=1, overrides=(*SMALL, *COUNTS))
    assert [row.unit for row in rows] == ["s"] * 5
    assert all(row.ratio == pytest.approx(row.ours / row.theirs) and not row.at_least for row in rows)
    rows += limits.rows(faces=400, runs=40, most=2)
    assert {row.target for row in rows} == {None}
    assert rows[5].against == "allowed CPU seconds"


def test_steps_and_refits_of_many_parts_are_compared_with_those_of_few():
    assert len(np.unique(parts.ball_of_parts(parts.MANY).labels)) == parts.MANY
    rows = parts.rows(repetitions=1, overrides=(*SMALL, *COUNTS, "trainer.refit=1", "data.part_points=400"))
    assert [row.what.split(" parts")[0] for row in rows] == [
        "step of fast, 200",
        "refit of the last layer, 6",
        "refit of the last layer, 200",
    ]
    assert all(row.ratio == pytest.approx(row.ours / row.theirs) and row.target is None for row in rows)


def test_without_its_polynomials_a_step_is_not_orthogonal_and_with_them_it_is():
    """What the benchmark leaves out is the iteration, and nothing else."""
    given = torch.randn(2, 24, 24, generator=torch.Generator().manual_seed(0))
    left_out = orthogonalise(given, ())
    torch.testing.assert_close(left_out, given / torch.linalg.matrix_norm(given, keepdim=True))
    assert torch.linalg.svdvals(orthogonalise(given, ITERATIONS["five"]))[:, -2].min() > 0.3


def test_extraction_and_overhead_give_rows():
    rows = extraction.rows(resolution=24, steps=2, part=500, plate=24, repetitions=1)
    assert [row.unit for row in rows] == ["s", "s", "s", "GiB"]
    (row,) = overhead.rows(steps=4, repetitions=1)
    assert row.ratio == pytest.approx(row.ours / row.theirs - 1)


def test_measures_are_the_same_together_and_alone():
    together, allowed = measures.rows(resolution=24, repetitions=1)
    assert together.ours == allowed.ours
    assert together.ratio == pytest.approx(together.theirs / together.ours)
    assert together.target is allowed.target is None


def test_progress_is_what_the_previews_measured(tmp_path: Path):
    outputs = [f"paths.outputs={tmp_path}", *SMALL, *COUNTS, "trainer.max_steps=6"]
    row = run(composed("trainer.preview_every=2", "trainer.preview_resolution=16", *outputs))
    folder = tmp_path / "fast" / "base" / "siren" / "part_01" / "seed0"
    progress.main([str(tmp_path / "to"), str(folder)])
    with (tmp_path / "to" / "progress.csv").open() as file:
        found = list(csv.DictReader(file))
    assert [(point["recipe"], point["shape"], point["step"]) for point in found] == [
        ("fast", "part_01", "2"),
        ("fast", "part_01", "4"),
    ]
    assert float(found[0]["seconds"]) == pytest.approx(row.seconds["fit"] / 3, abs=0.06)
    assert (tmp_path / "to" / "progress.png").stat().st_size > 1000
    run(composed("variant=blind", *outputs))
    with pytest.raises(SystemExit, match="no previews"):
        progress.main([str(tmp_path / "to"), str(tmp_path / "fast" / "blind" / "siren" / "part_01" / "seed0")])


def test_quality_gives_seconds_memory_and_scores_and_claims_nothing_of_smaller_runs():
    rows = quality.rows(("part_01",), prefix=2, overrides=(*SMALL, *COUNTS, "trainer.max_steps=2"))
    assert [row.what for row in rows if row.against == "allowed seconds"] == ["fast, part_01"]
    assert [row.what for row in rows if row.against == "its floor"] == [
        "fast, part_01: cd_l1",
        "points, part_01: cd_l1",
    ]
    assert {row.target for row in rows} == {None}
    memory = rows[0]
    assert memory.ratio == pytest.approx(memory.ours / quality.GIB)


def test_the_summary_counts_the_targets():
    rows = [
        Row("a", "b", 1.0, 4.0, "s", 4.0, 3.5),
        Row("c", "d", 1.0, 2.0, "s", 2.0, 3.5),
        Row("e", "f", 1.0, 2.0, "s", 0.5, 1.0, at_least=False),
        Row("g", "h", 1.0, 2.0, "s", 2.0),
    ]
    lines = table(rows)
    assert len(lines) == 6
    assert lines[-1] == "2 of 3 targets met; missed: c"


def test_sides_are_timed_in_turn():
    order: list[str] = []
    medians = interleaved(2, lambda: order.append("a"), lambda: order.append("b"))
    assert order == ["a", "b"] * 3
    assert len(medians) == 2


def test_libigls_octree_is_compared_by_every_way() -> None:
    rows = extraction.octree_rows({"part_01": 24}, repetitions=1, overrides=(*SMALL, "trainer.max_steps=2"))
    assert [row.unit for row in rows] == ["s", "points", "vertices", "edges"] * 3
    assert rows[-2].ours == rows[-2].theirs, "followed our way, the octree gives our mesh"


def test_signs_are_counted_against_the_exact_winding_number(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("JOINTSDF_ABC", raising=False)
    rows = signs.rows(points=200, most=2)
    assert [(row.ours, row.theirs) for row in rows] == [(0, 400), (0, 200)] * 3
    assert {row.what for row in rows} == {"signs at 200 points of 2 built-in parts"}


def test_sphere_tracing_of_an_exact_distance_loses_nothing_and_of_a_stretched_one_passes_through():
    mesh = trimesh.creation.icosphere(4, 0.5)
    corners = np.asarray(mesh.triangles)
    known = ExactDistance(LabelledMesh(mesh.vertices, mesh.faces, np.zeros(len(mesh.faces), int)), watertight=True)
    ends, lost = tracing.compare(known.signed, corners, 2000)
    assert lost == 0
    assert len(ends) > 900
    assert np.abs(known.signed(ends)).max() < tracing.HIT
    slab = trimesh.creation.box((1, 1, 0.02))
    thin = ExactDistance(LabelledMesh(slab.vertices, slab.faces, np.zeros(12, int)), watertight=True)
    assert tracing.compare(thin.signed, np.asarray(slab.triangles), 500)[1] == 0
    assert tracing.compare(lambda points: 1.2 * thin.signed(points), np.asarray(slab.triangles), 500)[1] > 0.2


def test_a_grid_interpolates_a_linear_field_exactly_and_its_gradient_is_that_of_differences():
    rng = np.random.default_rng(0)
    low, high = np.array([-1.0, 0, 2]), np.array([1.0, 3, 4])
    axes = [np.linspace(a, b, 5) for a, b in zip(low, high, strict=True)]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    points = rng.uniform(low, high, (200, 3))
    slope = np.array([0.3, -0.5, 0.7])
    value, gradient = grids.trilinear(places @ slope, low, high)(points)
    np.testing.assert_allclose(value, points @ slope, atol=1e-12)
    np.testing.assert_allclose(gradient, np.tile(slope, (200, 1)), atol=1e-12)
    rough = grids.trilinear(rng.standard_normal((5, 5, 5)), low, high)
    step = 1e-7
    for axis, column in zip(np.eye(3), rough(points)[1].T, strict=True):
        by_differences = (rough(points + step * axis)[0] - rough(points - step * axis)[0]) / (2 * step)
        assert np.median(np.abs(by_differences - column)) < 1e-6
    found = grids.rows(["part_02"], [16, 48], points=500)
    coarse, fine = (next(row.ours for row in found if row.what == f"grid {n}^3: sdf_relative_mean") for n in (16, 48))
    assert 0 < fine < coarse < 0.5


def test_the_mesh_is_exact_and_the_grid_nearly_beside_a_field():
    overrides = ["recipe=smoke", "trainer.max_steps=2", "extraction.resolution=24", "data.pool_size=500"]
    found = representations.rows(["part_02"], 300, 48, overrides)
    by_peer = {
        peer: {row.what.removeprefix("part_02: field, "): row for row in found if row.against == peer}
        for peer in ("mesh", "grid of 48^3")
    }
    mesh, grid = by_peer.values()
    assert mesh.keys() == grid.keys()
    assert len(mesh) == 8
    assert max(mesh[column].theirs for column in representations.COLUMNS[::2]) < 1e-12
    assert max(mesh[column].theirs for column in representations.COLUMNS[1::2]) < 1e-4
    assert mesh["wrong parts"].theirs < 0.02 < 0.1 < mesh["wrong parts"].ours
    assert 0 < grid["sdf_relative_mean"].theirs < 0.1 < grid["sdf_relative_mean"].ours
    assert grid["kilobytes"].theirs == 5 * 48**3 / 1000
    assert {row.ours for row in found if "kilobytes" in row.what} == {mesh["kilobytes"].ours}


def test_tracing_gives_rows_of_a_fitted_field():
    overrides = ["recipe=smoke", "trainer.max_steps=2", "extraction.resolution=24", "data.pool_size=500"]
    found = tracing.rows(["part_02"], 200, overrides)
    assert len(found) == 3
    assert all(row.target is None for row in found)


def test_queries_are_compared_with_their_products_and_nothing_is_claimed_of_few_points():
    rows = queries.rows(points=700, repetitions=1)
    assert [row.against.partition(",")[0] for row in rows] == [
        "matrix products alone",
        "matrix products alone",
        "sines and cosines alone",
        "the training's pass",
    ] * 3
    assert all(row.ratio == pytest.approx(row.theirs / row.ours) and row.target is None for row in rows)
    assert queries.claimed(rows[0].against, queries.LARGE)
    assert not queries.claimed(rows[2].against, queries.LARGE)


def test_the_products_of_a_query_are_one_pass_for_the_value_and_one_for_the_gradient(small_field):
    field = small_field("siren")
    value = 2 * (3 * 16 + 2 * 16 * 16 + 16)
    gradient = 2 * (3 * 16 + 2 * 16 * 16)
    head = 2 * (19 * 16 + 16 * 8 + 8 * 4)
    counted = [queries.flop(queries.product_shapes(field, what)) for what in queries.KINDS.values()]
    assert counted == [value, value + gradient, value + gradient + head]


def test_simplification_leaves_fewer_faces_at_the_same_distance():
    box = trimesh.creation.box().subdivide().subdivide()
    mesh = LabelledMesh(np.array(box.vertices), np.array(box.faces), np.zeros(len(box.faces), dtype=np.int64))
    protocols = {"unit": Protocol("unit", 500, "truth", {"surface_distance": SurfaceDistance()})}
    faces, distance, _ = simplification.simplified("box", mesh, GroundTruth(mesh, protocols), 1e-4, 1.0)
    assert (faces.ours, faces.theirs) == (12, 192)
    assert max(distance.ours, distance.theirs) < 1e-6
