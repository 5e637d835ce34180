"""Label files beside a mesh."""

from pathlib import Path

import numpy as np
import pytest
from mesh_files import BOX, SIDES, exported, load, put

from jointsdf.errors import InputError
from jointsdf.shapes.labels.beside import find_label_file


@pytest.mark.parametrize("mesh", ["bracket v2.1.stl", "bracket v2.1.STL.gz"])
@pytest.mark.parametrize("ending", ["npy", "txt", "ply"])
@pytest.mark.parametrize("mark", [".labels", "_labels"])
def test_a_mesh_has_the_label_file_of_its_stem(tmp_path: Path, mesh, mark, ending) -> None:
    assert find_label_file(tmp_path / mesh) is None
    (tmp_path / "labels.npy").touch()
    (tmp_path / "bracket v2.labels.npy").touch()
    (tmp_path / "bracket v2.1.npy").touch()
    assert find_label_file(tmp_path / mesh) == tmp_path / "labels.npy"
    own = tmp_path / f"bracket v2.1{mark}.{ending}"
    own.touch()
    assert find_label_file(tmp_path / mesh) == own


def test_two_label_files_are_refused(tmp_path: Path) -> None:
    for name in ("a.labels.npy", "a_labels.txt"):
        (tmp_path / name).touch()
    with pytest.raises(InputError, match=r"a.labels.npy and a_labels.txt"):
        find_label_file(tmp_path / "a.stl")
    path = put(tmp_path, "a.ply", exported("ply"))
    np.save(tmp_path / "a.labels.npy", SIDES)
    assert load(path, labels=str(tmp_path / "a.labels.npy")).label_provider == "file:a.labels.npy"


def test_auto_takes_them(tmp_path: Path) -> None:
    path = put(tmp_path, "box.ply", exported("ply"))
    np.save(tmp_path / "box.labels.npy", SIDES)
    np.save(tmp_path / "labels.npy", np.zeros(len(BOX.faces), int))
    shape = load(path)
    assert shape.label_provider == "file:box.labels.npy"
    assert len(shape.mesh.part_ids) == 6
