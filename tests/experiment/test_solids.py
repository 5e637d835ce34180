"""Solids of the parts of a run, where its config asks for them."""

from pathlib import Path

import numpy as np
import pytest
from analytic import box_distance
from omegaconf import OmegaConf
from solids import halves

from jointsdf.experiment import solids
from jointsdf.extraction.part_solids import part_solids
from jointsdf.shapes.readers.mesh_file import read_mesh
from jointsdf.values import LabelledMesh, Shape, Unit

WHOLE = halves()
SHAPE = Shape("halves", WHOLE, "0" * 64, "builtin", True, unit=Unit("cm", 0.01))


def to_halves(points: np.ndarray) -> np.ndarray:
    return box_distance(points - [0.5, 0, 0], (2, 1, 1))


def save(folder: Path, mesh: LabelledMesh, suffix: str | None, monkeypatch: pytest.MonkeyPatch, field) -> None:
    monkeypatch.setattr(solids, "field_part_solids", lambda _, given: part_solids(given, to_halves, 16))
    solids.save_solids(OmegaConf.create({"part_solids": suffix}), folder, SHAPE, mesh, field)


def test_they_are_files_of_the_run_folder_in_its_unit(tmp_path: Path, monkeypatch, small_field) -> None:
    save(tmp_path, WHOLE, "ply", monkeypatch, small_field())
    assert sorted(path.name for path in (tmp_path / "parts").iterdir()) == ["part_4.ply", "part_9.ply"]
    found = read_mesh(tmp_path / "parts/part_9.ply")
    assert found.unit == SHAPE.unit
    assert set(found.columns["label"].values.tolist()) == {9}


def test_by_default_there_are_none(tmp_path: Path, monkeypatch, small_field) -> None:
    save(tmp_path, WHOLE, None, monkeypatch, small_field())
    assert not list(tmp_path.iterdir())


def test_a_surface_that_is_not_closed_is_said_and_the_run_goes_on(
    tmp_path: Path, monkeypatch, small_field, caplog: pytest.LogCaptureFixture
) -> None:
    torn = LabelledMesh(WHOLE.vertices, WHOLE.faces[1:], WHOLE.labels[1:])
    save(tmp_path, torn, "stl", monkeypatch, small_field())
    assert "no parts/: solids of parts: a surface is not closed" in caplog.text
    assert not list(tmp_path.iterdir())
