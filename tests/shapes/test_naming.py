"""Names of shapes."""

import hashlib
from pathlib import Path

import pytest
from mesh_files import OFF, exported, load, put

from jointsdf.shapes import name_of, shape_names


@pytest.mark.parametrize(
    ("stem", "name"),
    [
        ("my part (v2)", "my_part__v2_"),
        ("ä=1,b", "ä_1_b"),
        ("a\u0308", "ä"),
        ("\u96f6\u4ef6", "\u96f6\u4ef6"),
        ("\u96f6" * 80, "\u96f6" * 66),
        ("bolt \U0001f529", "bolt__"),
        ("x" * 200, "x" * 100),
        (".x", "x"),
        ("a.b-c_1", "a.b-c_1"),
    ],
)
def test_name_of_a_path_is_safe_for_a_folder(tmp_path: Path, stem: str, name: str) -> None:
    shape = load(put(tmp_path, f"{stem}.off", OFF))
    assert shape.name == f"{name}-{hashlib.sha256(OFF.encode()).hexdigest()[:6]}"


def test_names_without_loading_are_those_of_the_loaded_shapes(tmp_path: Path) -> None:
    settings = {"abc_root": tmp_path, "abc_missing": "fallback"}
    for shape in ("part_07", "abc_0001", str(put(tmp_path, "a b.ply", exported("ply")))):
        assert name_of(shape, **settings) == load(shape, abc_root=tmp_path).name
    assert name_of("abc_0001", abc_root=tmp_path, abc_missing="error") == "abc_0001"
    assert name_of("no such/mesh.ply", **settings) == "mesh"


def test_every_name_is_listed_once() -> None:
    names = shape_names()
    assert names[0] == "part_01"
    assert names[-1] == "abc_0050"
    assert len(set(names)) == len(names) == 100
