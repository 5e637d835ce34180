import hashlib
import importlib.util
import logging
import os
from pathlib import Path

import numpy as np
import pytest
import trimesh
from mesh_files import load, put
from step_files import INCH, METRE, MILLIMETRE, NEEDS_READER, ONE, TOUCHING, step_boxes

from jointsdf.errors import InputError
from jointsdf.shapes.readers import step

DATA = Path(os.environ.get("JOINTSDF_ABC", "absent")).parent


def solid(vertices: np.ndarray, faces: np.ndarray) -> trimesh.Trimesh:
    return trimesh.Trimesh(vertices, faces, process=False)


@NEEDS_READER
@pytest.mark.parametrize(("unit", "metres"), [(MILLIMETRE, 1e-3), (METRE, 1.0), (INCH, 0.0254)])
def test_box_keeps_the_units_of_its_file(unit: tuple[str, ...], metres: float) -> None:
    mesh = step.read_step(Path("box.step"), step_boxes([((5, 6, 7), (6, 8, 10))], unit).encode())
    assert mesh.unit is not None
    assert mesh.unit.metres == pytest.approx(metres, rel=1e-12)
    np.testing.assert_allclose(np.unique(mesh.vertices[:, 2].round(5)), [7, 10])
    assert len(mesh.vertices) == 8
    assert solid(mesh.vertices, mesh.faces).is_watertight
    assert solid(mesh.vertices, mesh.faces).volume == pytest.approx(6.0, rel=1e-5)
    assert mesh.patches.tolist() == np.repeat(np.arange(6), 2).tolist()
    assert mesh.surfaces == ("plane",) * 6


@NEEDS_READER
def test_a_shape_is_in_the_unit_of_its_file(tmp_path: Path) -> None:
    inches = load(put(tmp_path, "a.step", step_boxes(ONE, INCH))).unit
    assert (inches.name, inches.metres, inches.known) == ("in", 0.0254, True)
    assert load("part_01").unit.known is False


@NEEDS_READER
def test_bodies_that_touch_stay_closed_and_keep_their_faces(tmp_path: Path) -> None:
    path = put(tmp_path, "two boxes.STP", step_boxes(TOUCHING))
    shape = load(path, labels="brep", segmented=True)
    assert shape.name == f"two_boxes-{hashlib.sha256(path.read_bytes()).hexdigest()[:6]}"
    assert shape.mesh_sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert (shape.watertight, shape.label_provider) == (True, "brep")
    mesh = solid(shape.mesh.vertices, shape.mesh.faces)
    assert sorted(abs(body.volume) for body in mesh.split()) == pytest.approx([6, 18], rel=1e-5)
    assert np.bincount(shape.mesh.labels).tolist() == [2] * 12
    for patch in range(12):
        normals = mesh.face_normals[shape.mesh.labels == patch]
        np.testing.assert_allclose(normals[0], normals[1], atol=1e-6)


@NEEDS_READER
def test_a_painted_side_keeps_its_place_and_its_id() -> None:
    plain, painted = (step.read_step(Path("x.step"), step_boxes(ONE, painted=side).encode()) for side in (None, 3))
    np.testing.assert_array_equal(plain.vertices[plain.faces], painted.vertices[painted.faces])
    assert painted.patches.tolist() == plain.patches.tolist()


@NEEDS_READER
def test_a_byte_order_mark_before_the_file_is_left_out() -> None:
    mesh = step.read_step(Path("x.step"), b"\xef\xbb\xbf" + step_boxes(ONE).encode())
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx([1, 2, 3], rel=1e-6)


@NEEDS_READER
def test_columns_name_face_body_and_colour() -> None:
    one, two, coloured = (
        step.read_step(Path("x.step"), step_boxes(boxes, painted=side).encode()).file_mesh
        for boxes, side in ((ONE, None), (TOUCHING, None), (TOUCHING, 3))
    )
    assert sorted(one.columns) == ["body", "face"]
    assert one.columns["face"].values.tolist() == np.repeat(np.arange(6), 2).tolist()
    assert set(one.columns["body"].values) == {0}
    assert two.columns["body"].values.tolist() == [0] * 12 + [1] * 12
    assert coloured.columns["body"].values.tolist() == [0] * 12 + [1] * 12
    assert coloured.columns["colour"].values.tolist() == [0] * 6 + [1] * 2 + [0] * 16
    assert [coloured.columns[name].are_ids for name in ("face", "body", "colour")] == [True, False, False]


@NEEDS_READER
def test_touching_bodies_in_two_colours_keep_them_at_the_wall_they_share() -> None:
    mesh = step.read_step(Path("x.step"), step_boxes(TOUCHING, painted=[*range(6)]).encode())
    assert mesh.colours is not None
    assert mesh.colours.tolist() == [0] * 12 + [1] * 12


@NEEDS_READER
@pytest.mark.parametrize(("offset", "told"), [(1e3, False), (4e6, True)])
def test_coordinates_coarser_than_the_part_are_told(
    offset: float, told: bool, caplog: pytest.LogCaptureFixture
) -> None:
    corner = np.full(3, offset)
    mesh = step.read_step(Path("x.step"), step_boxes([(tuple(corner), tuple(corner + 50))]).encode())
    assert np.abs(mesh.vertices.max(axis=0) - offset - 50).max() <= np.spacing(np.float32(offset))
    assert ("in steps of 0.24 mm; move it to the origin" in caplog.text) == told


@NEEDS_READER
def test_which_labels_a_step_file_gets(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = put(tmp_path, "box.step", step_boxes(ONE))
    mesh = step.read_step(path, path.read_bytes())
    monkeypatch.setattr(step, "read_step", lambda *_, **__: mesh)
    np.save(tmp_path / "patches.npy", np.zeros(12, dtype=int))
    assert load(path, labels="brep").label_provider == "brep"
    assert load(path, labels="brep").mesh.labels.tolist() == mesh.patches.tolist()
    parts = load(path, labels="auto", num_parts=6)
    assert parts.label_provider == "geometric:k=6"
    assert len(set(zip(parts.mesh.labels.tolist(), mesh.patches.tolist(), strict=True))) == 6
    assert set(load(path, labels="none").mesh.labels) == {-1}
    np.save(tmp_path / "labels.npy", np.arange(12) + 5)
    assert load(path, labels="auto").label_provider == "file:labels.npy"
    assert load(path, labels="auto").mesh.labels.tolist() == list(range(5, 17))
    assert load(path, labels="brep").label_provider == "brep"
    np.save(tmp_path / "labels.npy", np.arange(11))
    with pytest.raises(InputError, match="11 labels, the mesh has 12 triangles, 8 vertices, 6 B-rep faces"):
        load(path)


BOX = step_boxes(ONE).encode()
EMPTY_DATA = BOX[: BOX.index(b"#1=")] + b"ENDSEC;\nEND-ISO-10303-21;\n"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b" \n", "is empty"),
        (b"solid box\nendsolid box\n", "no STEP file"),
        (bytes(range(256)), "no STEP file"),
        (BOX[:12], "is truncated"),
        (BOX[: len(BOX) // 2], "is truncated"),
        (BOX[:-10], "is truncated"),
        pytest.param(EMPTY_DATA, "damaged or holds no surface", marks=NEEDS_READER),
    ],
)
def test_what_is_no_whole_step_file_is_one_line(tmp_path: Path, content: bytes, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        load(put(tmp_path, "a.step", content))
    assert "\n" not in str(caught.value)
    assert "a.step" in str(caught.value)


@NEEDS_READER
def test_lost_records_are_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    lines = BOX.split(b"\n")
    loop = next(i for i, line in enumerate(lines) if b"POLY_LOOP" in line)
    shape = load(put(tmp_path, "a.step", b"\n".join(lines[:loop] + lines[loop + 1 :])))
    assert "damaged in places" in caplog.text
    assert not shape.watertight


def test_without_the_reader_the_line_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    with pytest.raises(InputError, match=r"pip install 'jointsdf\[step\]'"):
        step.read_step(Path("a.step"), BOX)


@pytest.mark.parametrize("options", [{"step_tolerance": 0.0}, {"step_tolerance": 2.0}, {"step_angle": -0.1}])
def test_tolerances_are_checked(tmp_path: Path, options: dict[str, float]) -> None:
    name, value = next(iter(options.items()))
    with pytest.raises(InputError, match=f"tessellation.{name.removeprefix('step_')}={value}: give a number, from"):
        load(put(tmp_path, "a.step", BOX), **options)


def check_surface(kind: str, normals: np.ndarray) -> None:
    """The normals of an analytic patch's triangles, as far as they tell its type."""
    if kind == "plane":
        np.testing.assert_allclose(normals, normals[:1].repeat(len(normals), axis=0), atol=1e-3)
    if kind == "cylinder":
        axis = np.linalg.svd(normals)[2][-1]
        np.testing.assert_allclose(normals @ axis, 0, atol=1e-3)
        assert np.ptp(normals, axis=0).max() > 0.1


@NEEDS_READER
@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "reference", "units", "patches"),
    [
        ("cad/base_interface_AP214.STEP", "cad/step_base_interface_AP214.ply", 25.4, 30),
        ("cad/featuretype.STEP", "cad/step_featuretype.ply", 25.4, 96),
        ("abc_raw/00000050_*_step_000.step", "abc_raw/00000050_*_trimesh_000.stl", 1.0, 43),
    ],
)
def test_real_files_agree_with_their_meshes(name: str, reference: str, units: float, patches: int) -> None:
    path = next(DATA.glob(name), None)
    if path is None:
        pytest.skip(f"no {name} beside the folder that JOINTSDF_ABC names")
    mesh = step.read_step(path, path.read_bytes())
    found, truth = solid(mesh.vertices, mesh.faces), trimesh.load(next(DATA.glob(reference)), force="mesh")
    assert found.is_watertight
    assert found.volume * units**3 == pytest.approx(truth.volume, rel=2e-3)
    np.testing.assert_allclose(found.bounds * units, truth.bounds, atol=0.02 * truth.extents.max())
    assert np.unique(mesh.patches).tolist() == list(range(patches))
    assert len(mesh.surfaces) == patches
    area = found.area_faces > 1e-7 * found.area
    for patch, kind in enumerate(mesh.surfaces):
        check_surface(kind, found.face_normals[area & (mesh.patches == patch)])


@NEEDS_READER
@pytest.mark.slow
def test_a_finer_tolerance_gives_a_truer_mesh(caplog: pytest.LogCaptureFixture) -> None:
    path = DATA / "cad/base_interface_AP214.STEP"
    if not path.is_file():
        pytest.skip("no cad folder beside the folder that JOINTSDF_ABC names")
    caplog.set_level(logging.WARNING)
    coarse = load(path, step_tolerance=1e-3, step_angle=0.5)
    fine = load(path)
    assert len(coarse.mesh.faces) < len(fine.mesh.faces) / 2
    assert coarse.watertight
    assert fine.watertight
    assert not [record for record in caplog.records if "component" not in record.message]
