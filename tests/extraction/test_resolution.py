"""Choice of the grid by the thinnest wall, and its refinement until the topology is stable."""

import json
import logging
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from analytic import box_distance
from command_line import train

from jointsdf.experiment import measurement
from jointsdf.experiment.tensorboard import extract
from jointsdf.extraction import resolution as module
from jointsdf.extraction.extractor import Extraction
from jointsdf.extraction.resolution import (
    CELLS,
    FEWEST_CLOSE,
    FINEST,
    cell_size,
    components_and_euler,
    count_close_faces,
    grid_warnings,
    refine_until_stable,
    resolution_for,
    thin_wall_warning,
)
from jointsdf.model.field import JointField
from jointsdf.values import BOX

Sdf = Callable[[np.ndarray], np.ndarray]
LADDER = (32, 48, 72, 108)
CELL = 2 * BOX / 31  # of the coarsest
TURN = np.linalg.qr(np.random.default_rng(0).standard_normal((3, 3)))[0]


def turned_box(points: np.ndarray, half: tuple[float, float, float]) -> np.ndarray:
    return box_distance(points @ TURN, half)


def plate(thickness: float) -> Sdf:
    return lambda points: turned_box(points, (0.6, 0.5, thickness * CELL / 2))


def fin(thickness: float) -> Sdf:
    """A block with a thin wall standing on it, which a coarse grid breaks."""
    half = (0.6, 0.25, thickness * CELL / 2)
    return lambda points: np.minimum(turned_box(points, (0.45, 0.45, 0.4)), turned_box(points - 0.3 * TURN[:, 0], half))


def slit(width: float) -> Sdf:
    """A block with a slit from above, which a coarse grid bridges."""
    half = (0.9, width * CELL / 2, 0.4)
    return lambda points: np.maximum(turned_box(points, (0.6, 0.5, 0.4)), -turned_box(points - 0.3 * TURN[:, 2], half))


@pytest.mark.parametrize(("sdf", "resolution"), [(fin(0.9), 48), (slit(0.8), 72)], ids=["fin", "slit"])
def test_a_grid_that_breaks_a_wall_or_bridges_a_gap_is_refined(sdf: Sdf, resolution: int) -> None:
    assert components_and_euler(Extraction(32).surface(sdf)) != (1, 2), "no test: the coarse grid is fine enough"
    extraction, surface = refine_until_stable(Extraction(32), sdf, LADDER)
    assert extraction == Extraction(resolution)
    assert components_and_euler(surface) == (1, 2)
    np.testing.assert_array_equal(extraction.surface(sdf).vertices, surface.vertices)


def test_a_grid_stays_if_the_next_one_has_the_same_topology(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    extraction, surface = refine_until_stable(Extraction(32), fin(1.2), LADDER)
    assert extraction == Extraction(32)
    assert components_and_euler(surface) == (1, 2)
    assert "faces are within a cell of another one: compared with 48^3" in caplog.text


def test_without_thin_places_the_field_is_evaluated_on_one_grid_alone() -> None:
    asked: list[int] = []

    def counted(points: np.ndarray) -> np.ndarray:
        asked.append(len(points))
        return plate(3)(points)

    once = Extraction(32).surface(plate(3))
    extraction, surface = refine_until_stable(Extraction(32), counted, LADDER)
    assert extraction == Extraction(32)
    assert sum(asked) == round(once.evaluated * 32**3)
    np.testing.assert_array_equal(surface.faces, once.faces)


def test_a_thin_plate_gets_the_grid_that_holds_it_together() -> None:
    extraction, surface = refine_until_stable(Extraction(32), plate(0.5), LADDER)
    assert extraction == Extraction(72), "six pieces at 32, ten at 48"
    assert components_and_euler(surface) == (1, 2)


@pytest.mark.parametrize(
    ("most", "resolution", "reason"),
    [(10**9, 48, "no finer grid is left"), (48**3 // 10, 32, "48^3 would take too long")],
    ids=["beyond the finest", "the next takes too long"],
)
def test_walls_that_no_grid_can_show_give_a_warning(
    most: int, resolution: int, reason: str, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MOST_POINTS", most)
    extraction, _ = refine_until_stable(Extraction(32), slit(0.8), (32, 48))
    assert extraction == Extraction(resolution)
    [warning] = [record.getMessage() for record in caplog.records if record.levelname == "WARNING"]
    assert warning.startswith(f"{resolution}^3: ")
    assert warning.endswith(
        "faces are within a cell of another one: walls may be broken and gaps bridged there; " + reason
    )


@pytest.mark.parametrize(("close", "resolution"), [(FEWEST_CLOSE - 1, 32), (FEWEST_CLOSE, 48)])
def test_a_few_close_faces_are_slivers(close: int, resolution: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "count_close_faces", lambda _, at: close if at == 32 else 0)
    assert refine_until_stable(Extraction(32), fin(0.9), LADDER)[0] == Extraction(resolution)


def test_a_field_without_a_surface_keeps_the_first_grid() -> None:
    extraction, surface = refine_until_stable(Extraction(32), lambda points: np.ones(len(points)), LADDER)
    assert extraction == Extraction(32)
    assert len(surface.faces) == 0


def test_both_sides_of_a_thin_wall_count_and_a_thick_one_has_none() -> None:
    fine = Extraction(128).surface(plate(0.9))
    assert count_close_faces(fine, 32) > 0.8 * len(fine.faces)  # cells of 32 points an axis
    assert count_close_faces(fine, 64) == 0  # the wall is 1.8 of these
    assert count_close_faces(Extraction(32).surface(plate(6)), 32) == 0


def test_a_run_takes_the_finer_grid_and_its_row_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`auto` of a shape without thin walls starts at 256; here the ladder is short, and the fit too short for it."""
    monkeypatch.setattr(module, "LADDER", (16,))
    finer = Extraction(24, borders="split")
    monkeypatch.setattr(measurement, "refine_until_stable", lambda _, sdf: (finer, finer.surface(sdf)))
    assert train(tmp_path, "extraction.resolution=auto").code == 0
    row = json.loads(next(tmp_path.rglob("result.json")).read_text())
    assert row["provenance"]["resolution"] == 24
    field = JointField.load(next(tmp_path.rglob("field.ckpt")))
    assert row["provenance"]["grid_cell"] == pytest.approx(2 * BOX * field.normalisation.scale / 23)
    mesh = extract(field, finer)
    assert row["counts"]["faces_pred"] == len(mesh.faces)


def test_every_step_of_the_ladder_is_taken_and_no_wall_is_the_coarsest() -> None:
    for coarser, finer in pairwise(module.LADDER):
        wall = CELLS * 2 * BOX / (coarser - 1)
        assert (resolution_for(1.001 * wall), resolution_for(0.999 * wall)) == (coarser, finer)
    assert resolution_for(float("inf")) == module.LADDER[0]
    assert resolution_for(0.0) == FINEST


def test_a_wall_under_two_cells_warns_with_the_resolution_that_holds_it() -> None:
    warning = thin_wall_warning(0.1, 128, 10.0, "mm")
    assert warning is not None
    assert "thinnest wall (0.1 mm) is under 2 cells of the grid (of 0.173 mm)" in warning
    enough = int(warning.rpartition("=")[2])
    assert thin_wall_warning(0.1, enough, 10.0, "mm") is None
    assert thin_wall_warning(0.1, enough - 1, 10.0, "mm") is not None
    assert f"no grid up to {FINEST} can hold it" in str(thin_wall_warning(0.01, 256, 10.0, "mm"))
    assert thin_wall_warning(float("inf"), 8, 1.0, "mm") is None


def test_a_cell_is_the_boxs_side_by_the_intervals_of_the_grid() -> None:
    assert cell_size(111) == pytest.approx(2 * BOX / 110)


def test_parts_that_the_finest_grid_holds_decide_the_grid() -> None:
    needed = CELLS * cell_size(384)
    assert resolution_for(1.0, [1.001 * needed, 2.0]) == 384
    assert resolution_for(1.0, [0.999 * needed]) == 512
    assert resolution_for(1.0, [0.999 * CELLS * cell_size(FINEST)]) == module.LADDER[0]  # no grid helps
    assert resolution_for(0.999 * CELLS * cell_size(512), [1.0]) == 768


def test_parts_under_a_cell_are_named_narrowest_first_with_the_resolution_that_holds_them() -> None:
    cell = cell_size(256) * 10.0
    widths = {3: 0.5 * cell, 4: 1.001 * cell, 9: 0.4 * cell}
    (warning,) = grid_warnings(float("inf"), widths, 256, 10.0, "mm")
    assert f"parts narrower than a cell of the grid ({cell:.3g} mm) may vanish" in warning
    assert f": 9 ({0.4 * cell:.3g} mm), 3 ({0.5 * cell:.3g} mm); " in warning
    enough = int(warning.rpartition("=")[2])
    assert grid_warnings(float("inf"), widths, enough, 10.0, "mm") == []
    assert len(grid_warnings(float("inf"), widths, enough - 1, 10.0, "mm")) == 1
    assert "no grid up to 1024 can hold them all" in grid_warnings(1.0, {0: 1e-4}, 256, 1.0, "mm")[0]
    assert " and 3 more; " in grid_warnings(1.0, dict.fromkeys(range(11), 0.004), 256, 1.0, "mm")[0]
