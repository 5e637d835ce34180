"""Shapes from ABC's files and archives on the disk."""

from pathlib import Path

import numpy as np
from abc_files import (
    FILES,
    MODEL,
    NAME,
    OBJ,
    YML,
    assert_box_is_prepared,
    filled,
    outcomes,
)
from step_files import NEEDS_READER, step_boxes

from jointsdf import shapes
from jointsdf.abc_dataset import prepare
from jointsdf.shapes import abc

OTHER_NAME, OTHER = "abc_0004", "00000009_9b3d6a97e8de4aa193b81000"


def test_extracted_files_become_a_shape_in_the_catalogues_unit(tmp_path: Path) -> None:
    (status, detail), *_ = outcomes(tmp_path / "root", filled(tmp_path / "abc" / "obj" / "00000007")).values()
    assert status == prepare.DONE
    assert "6 patches" in detail
    assert "times 1000" in detail
    assert_box_is_prepared(tmp_path / "root")
    loaded = shapes.load(NAME, abc_root=tmp_path / "root", labels="brep")
    assert loaded.watertight
    assert sorted(np.unique(loaded.mesh.labels, return_counts=True)[1]) == [2] * 6


def test_files_of_another_document_are_not_the_model(tmp_path: Path) -> None:
    files = {OBJ.replace("b33a", "b33b"): FILES[OBJ]}
    status, detail = outcomes(tmp_path, filled(tmp_path / "in", files))[NAME]
    assert (status, MODEL in detail) == (prepare.ABSENT, True)


def test_one_bad_model_does_not_stop_the_others(tmp_path: Path) -> None:
    beyond = FILES[YML].replace(b"face_indices: [", b"face_indices: [12, ", 1)
    other = {f"{OTHER}_trimesh_001.obj": FILES[OBJ], f"{OTHER}_features_001.yml": beyond}
    found = outcomes(tmp_path, filled(tmp_path / "in", FILES | other), names=(OTHER_NAME, NAME))
    assert found[NAME][0] == prepare.DONE
    assert found[OTHER_NAME][0] == prepare.FAILED
    assert "names face 12, the mesh has 0..11" in found[OTHER_NAME][1]
    assert not (tmp_path / OTHER_NAME).exists()


def test_with_all_formats_there_the_preferred_one_is_taken(tmp_path: Path) -> None:
    entry = abc.catalogue()[NAME]
    files = FILES | {f"{MODEL}_step_000.step": step_boxes([((0, 0, 0), entry.extents)]).encode()}
    source = filled(tmp_path / "in", files)
    assert f"from {OBJ}" in outcomes(tmp_path / "a", source)[NAME][1]
    if NEEDS_READER.args[0] is False:
        assert ".step" in outcomes(tmp_path / "b", source, preferred="step")[NAME][1]
