"""Matching of parts, and errors per face."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawings import labelled, pair
from study_rows import make_row, write

from jointsdf.errors import InputError
from jointsdf.study.figures import run_meshes as meshes


def test_parts_are_matched_to_those_that_they_cover() -> None:
    truth = labelled()
    permuted = pair(replace(truth, labels=np.array([3, 5, 4, 0, 2, 1])[truth.labels]))
    assert (permuted.matched.labels == truth.labels).all()
    assert permuted.wrong.all()
    split_in_two = truth.labels.copy()
    split_in_two[np.flatnonzero(truth.labels == 2)[:4]] = 9
    extra = pair(replace(truth, labels=split_in_two))
    assert (extra.matched.labels[extra.predicted.labels != 9] == truth.labels[split_in_two != 9]).all()
    assert extra.matched.labels[split_in_two == 9].min() > 9
    assert (extra.wrong == (split_in_two == 9)).all()


def test_errors_are_distances_in_shares_of_the_longest_side() -> None:
    longer = pair(labelled(scale=1.1))
    ends = np.abs(meshes.centroids(longer.predicted)[:, 0]) > 1.09
    assert longer.error[ends] == pytest.approx(0.1 / 2)
    assert longer.error[~ends].max() <= 0.1 / 2 + 1e-9
    assert longer.missed.max() == pytest.approx(0.1 / 2)
    assert pair(labelled()).error.max() == pytest.approx(0.0, abs=1e-12)


def test_a_run_without_its_mesh_is_named(tmp_path: Path) -> None:
    write(tmp_path, make_row())
    with pytest.raises(InputError, match=r"run0000/mesh.ply is not there"):
        meshes.load_pair(tmp_path / "run0000")
