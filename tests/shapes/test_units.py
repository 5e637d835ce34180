"""Units of shapes: the file's own, the user's, or the assumed millimetre."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from mesh_files import BOX, OBJ, exported, load, put
from step_files import INCH, NEEDS_READER, ONE, step_boxes

import jointsdf
from jointsdf.errors import InputError
from jointsdf.shapes.units import choose_unit, unit_of_metres
from jointsdf.values import ASSUMED_UNIT, Unit
from jointsdf.viewing.export import write_mesh


@pytest.mark.parametrize(
    ("given", "unit"),
    [
        ("auto", ASSUMED_UNIT),
        ("in", Unit("in", 0.0254)),
        ("inch", Unit("in", 0.0254)),
        ("um", Unit("um", 1e-6)),
        ("mm", Unit("mm", 1e-3)),
    ],
)
def test_a_file_without_a_unit_has_the_one_given(tmp_path: Path, given: str, unit: Unit) -> None:
    path = put(tmp_path, "a.obj", OBJ)
    assert load(path, unit=given).unit == unit
    mesh = load(path).mesh
    assert jointsdf.load_shape(path, labels="none", unit=given).unit == unit
    assert jointsdf.load_shape(vertices=mesh.vertices, faces=mesh.faces, labels="none", unit=given).unit == unit


@NEEDS_READER
def test_a_step_file_has_its_own_unless_it_is_contradicted(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = put(tmp_path, "a.step", step_boxes(ONE, INCH))
    assert load(path).unit == load(path, unit="in").unit == Unit("in", 0.0254)
    assert "unit=" not in caplog.text
    assert load(path, unit="mm").unit == Unit("mm", 1e-3)
    assert "a.step: unit=mm is taken, although the file says that it is in in" in caplog.text


def test_an_unknown_unit_is_one_line() -> None:
    with pytest.raises(InputError, match=r"^unit=parsec: give one of mm, cm, m, um, in, ft, inch, or auto$"):
        choose_unit("a.obj", ASSUMED_UNIT, "parsec")


def test_units_are_named_by_their_size() -> None:
    names = [unit_of_metres(metres).name for metres in (1e-3, 0.01, 1.0, 0.0254, 2.54e-5, 0.3048, 0.9144, 0.5)]
    assert names == ["mm", "cm", "m", "in", "mil", "ft", "yd", "0.5m"]


def test_a_gltf_file_is_in_metres_with_y_up_and_is_written_so(tmp_path: Path) -> None:
    shape = load(put(tmp_path, "a.glb", exported("glb")))
    assert (shape.unit, shape.up) == (Unit("m", 1.0), "y")
    write_mesh(tmp_path / "run", shape.mesh, shape.unit, shape.up)
    np.testing.assert_allclose(trimesh.load_scene(tmp_path / "run" / "mesh.glb").bounds, BOX.bounds, rtol=0, atol=1e-6)
    for name in ("mesh.ply", "mesh.glb"):
        again = load(tmp_path / "run" / name)
        assert (again.unit, again.up) == (shape.unit, "y")
        np.testing.assert_allclose(again.mesh.vertices.min(axis=0), BOX.bounds[0], rtol=0, atol=1e-6)
