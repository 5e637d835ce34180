"""Columns of a mesh file's faces as labels."""

from pathlib import Path

import numpy as np
import pytest
from mesh_files import BOX, SIDES, painted, put

from jointsdf.errors import InputError
from jointsdf.shapes.labels.columns import choose_column, read_own_labels, split_column, suggest_columns
from jointsdf.shapes.readers.file_mesh import FaceColumn, FileMesh

IDS, TWO, ONE, MANY = SIDES, SIDES % 2, np.zeros(12, dtype=int), np.arange(12)


def mesh(**columns: np.ndarray) -> FileMesh:
    named = ("group", "material", "colour")
    found = {name: FaceColumn(values, are_ids=name not in named) for name, values in columns.items()}
    return FileMesh(np.array(BOX.vertices), np.array(BOX.faces), columns=found)


def test_a_column_follows_an_existing_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    put(tmp_path, "a.ply", "")
    put(tmp_path, "b:c.ply", "")
    assert split_column("a.ply") == (Path("a.ply"), None)
    assert split_column("a.ply:colour") == (Path("a.ply"), "colour")
    assert split_column("a.ply:x:y") == (Path("a.ply"), "x:y")
    assert split_column("b:c.ply") == (Path("b:c.ply"), None)
    assert split_column("b:c.ply:label") == (Path("b:c.ply"), "label")
    assert split_column(f"{tmp_path}/a.ply:my label") == (tmp_path / "a.ply", "my label")
    for absent in ("c.ply", "c.ply:colour", ":colour", "a.ply:", "geometric"):
        assert split_column(absent) is None


@pytest.mark.parametrize(
    ("columns", "chosen"),
    [
        ({"label": ONE, "colour": IDS}, "label"),
        ({"colour": IDS, "group": TWO}, "colour"),
        ({"quality": TWO}, "quality"),
        ({"group": ONE, "material": IDS}, "material"),
    ],
)
def test_the_column_of_the_parts(columns: dict[str, np.ndarray], chosen: str) -> None:
    assert choose_column("it", mesh(**columns)) == chosen


def test_a_choice_or_none_is_refused_with_the_columns() -> None:
    with pytest.raises(InputError, match=r"it has no part labels.*one of group \(2 values\), material \(6 values\)"):
        choose_column("it", mesh(group=TWO, material=IDS, colour=ONE))
    with pytest.raises(InputError, match=r"it has no columns; give labels=<file.npy>"):
        choose_column("it", mesh())


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({"group": TWO}, "it: has 2 groups: labels=it:group takes them as parts"),
        ({"colour": IDS, "group": TWO}, "it: has 2 groups and 6 colours: labels=it:group takes"),
        ({"group": TWO, "material": IDS, "colour": TWO}, "has 2 groups, 6 materials and 2 colours: labels=it:group"),
        ({"segment": IDS}, "it: has 6 values of segment: labels=it:segment takes"),
        ({"group": ONE, "colour": IDS}, "it: has 6 colours: labels=it:colour takes"),
    ],
)
def test_columns_that_may_be_parts_are_suggested(columns: dict[str, np.ndarray], words: str) -> None:
    assert words in (suggest_columns("it", mesh(**columns)) or "")


def test_columns_that_are_hardly_parts_are_not_suggested() -> None:
    numbers = mesh(group=ONE, quality=np.linspace(0, 1, 12), face=IDS)
    assert suggest_columns("it", numbers) is None
    many = FileMesh(np.eye(3), np.tile([0, 1, 2], (65, 1)), columns={"colour": FaceColumn(np.arange(65), False)})
    assert suggest_columns("it", many) is None


def test_own_labels_of_a_file(tmp_path: Path) -> None:
    found = read_own_labels(put(tmp_path, "a.ply", painted()))
    assert found.labels.tolist() == SIDES.tolist()
    np.testing.assert_array_equal(found.vertices[found.faces], BOX.triangles)
    with pytest.raises(InputError, match=r"a.ply has no column 'label' of its faces: .*one of quality \(6 values\)"):
        read_own_labels(put(tmp_path, "a.ply", painted("quality")))
    with pytest.raises(InputError, match="holds -2: part ids"):
        read_own_labels(put(tmp_path, "a.ply", painted(values=SIDES - 2)))
