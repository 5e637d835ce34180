"""Reference scores are cached, and computed again where anything that decides them has changed."""

import json
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np
import pytest

from jointsdf.evaluation import reference_scores as module
from jointsdf.evaluation.protocol import GroundTruth, Protocol
from jointsdf.evaluation.reference_scores import ceiling_mesh, reference_scores
from jointsdf.extraction.extractor import Extraction
from jointsdf.metrics.chamfer import Chamfer
from jointsdf.metrics.exact_labels import ExactLabels
from jointsdf.runs.provenance import CodeState
from jointsdf.values import Normalisation, Shape

METRICS = {"chamfer": Chamfer(), "exact": ExactLabels()}
GRID = Extraction(24, borders="split")
FRAME = Normalisation(np.array([5.0, -3.0, 11.0]), 20.0)


def truth_of(shape: Shape, points: int = 300) -> GroundTruth:
    return GroundTruth(shape.mesh, {"unit": Protocol("unit", points, "truth", METRICS)})


def test_the_cache_holds_what_is_computed(box_shape: Shape, tmp_path: Path) -> None:
    anew = reference_scores(truth_of(box_shape), box_shape, GRID, FRAME, None)
    assert anew["unit"].keys() == {"cd_l1_floor", "cd_l2_floor", "miou_exact_ceiling", "acc_exact_ceiling"}
    assert 0.9 < anew["unit"]["miou_exact_ceiling"] <= 1
    assert reference_scores(truth_of(box_shape), box_shape, GRID, FRAME, tmp_path) == anew
    with mock.patch.object(module, "ceiling_mesh", side_effect=AssertionError("computed again")):
        assert reference_scores(truth_of(box_shape), box_shape, GRID, FRAME, tmp_path) == anew


def test_the_missing_numbers_of_an_unlabelled_shape_are_cached(box_shape: Shape, tmp_path: Path) -> None:
    bare = replace(box_shape, mesh=replace(box_shape.mesh, labels=np.full_like(box_shape.mesh.labels, -1)))
    first = reference_scores(truth_of(bare), bare, GRID, FRAME, tmp_path)
    kept = reference_scores(truth_of(bare), bare, GRID, FRAME, tmp_path)
    assert np.isnan(kept["unit"]["miou_exact_ceiling"])
    assert json.dumps(kept) == json.dumps(first)


@pytest.mark.parametrize("change", ["labels", "mesh", "grid", "frame", "protocol", "code"])
def test_any_change_is_computed_again(
    box_shape: Shape, tmp_path: Path, change: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    reference_scores(truth_of(box_shape), box_shape, GRID, FRAME, tmp_path)
    (kept,) = tmp_path.glob("*.json")
    kept.write_text(json.dumps({"unit": {"cd_l1_floor": -1.0}}))  # to be known by
    assert reference_scores(truth_of(box_shape), box_shape, GRID, FRAME, tmp_path)["unit"]["cd_l1_floor"] == -1
    shape, grid, frame, points = box_shape, GRID, FRAME, 300
    if change == "labels":
        shape = replace(shape, mesh=replace(shape.mesh, labels=np.roll(shape.mesh.labels, 1)))
    elif change == "mesh":
        shape = replace(shape, mesh_sha256="1" * 64)
    elif change == "grid":
        grid = replace(grid, resolution=25)
    elif change == "frame":
        frame = replace(frame, centre=frame.centre + 1e-9)
    elif change == "protocol":
        points = 301
    else:
        monkeypatch.setattr(module, "code_state", lambda: CodeState("0", False, "0"))
    found = reference_scores(truth_of(shape, points), shape, grid, frame, tmp_path)
    assert found == reference_scores(truth_of(shape, points), shape, grid, frame, None)
    assert found["unit"]["cd_l1_floor"] > 0


def test_ceiling_lies_on_the_shape_with_its_labels(box_shape: Shape, box_distance) -> None:
    mesh = ceiling_mesh(box_shape, Extraction(48, borders="split"), FRAME)
    on_grid = 2.2 * FRAME.scale / 47
    assert np.abs(box_distance(mesh.vertices)).max() < on_grid
    assert np.array_equal(mesh.part_ids, box_shape.mesh.part_ids)
