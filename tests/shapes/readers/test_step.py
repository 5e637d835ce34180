import hashlib
import importlib.util
import logging
import os
import sys
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
    assert mesh.unit == pytest.approx(metres, rel=1e-12)
    np.testing.assert_allclose(np.unique(mesh.vertices[:, 2].round(5)), [7, 10])
    assert len(mesh.vertices) == 8
    assert solid(mesh.vertices, mesh.faces).is_watertight
    assert solid(mesh.vertices, mesh.faces).volume == pytest.approx(6.0, rel=1e-5)
    assert mesh.patches.tolist() == np.repeat(np.arange(6), 2).tolist()
    assert mesh.surfaces == ("plane",) * 6


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
    with pytest.raises(InputError, match="11 labels, the mesh file has 12 faces"):
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


@NEEDS_READER
def test_a_crash_of_the_reader_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    crash = put(tmp_path, "crash", "#!/bin/sh\ncat > /dev/null\nkill -SEGV $$\n")
    crash.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(crash))
    with pytest.raises(InputError, match=r"a.step is damaged: the STEP reader crashed on it \(signal 11\)"):
        step.read_step(Path("a.step"), BOX)


def test_without_the_reader_the_line_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    with pytest.raises(InputError, match=r"pip install 'jointsdf\[step\]'"):
        step.read_step(Path("a.step"), BOX)


@pytest.mark.parametrize("options", [{"step_tolerance": 0.0}, {"step_tolerance": 2.0}, {"step_angle": -0.1}])
def test_tolerances_are_checked(tmp_path: Path, options: dict[str, float]) -> None:
    name, value = next(iter(options.items()))
    with pytest.raises(InputError, match=f"tessellation.{name.removeprefix('step_')}={value}: give a number, from"):
        load(put(tmp_path, "a.step", BOX), **options)


UNIT_RECORDS = {
    "#1=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.CENTI.,.METRE.))": 1e-2,
    "#1=(NAMED_UNIT(*)SI_UNIT( $ , .METRE. )\nLENGTH_UNIT())": 1.0,
    "#9=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(12.),#8);#8=(CONVERSION_BASED_UNIT('INCH',#7)LENGTH_UNIT());"
    "#7=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(0.02539999999999999897),#6);#6=(LENGTH_UNIT()SI_UNIT($,.METRE.));"
    "#1=(CONVERSION_BASED_UNIT('a; #3 ''foot''',#9)LENGTH_UNIT())": 0.3048,
    "#9=(LENGTH_MEASURE_WITH_UNIT()MEASURE_WITH_UNIT(LENGTH_MEASURE(25.4),#8));#8=(LENGTH_UNIT()SI_UNIT(.MILLI.,.METRE.));"
    "/* #1=x; 'y */ #1=(LENGTH_UNIT()CONVERSION_BASED_UNIT('INCH',#9))": 0.0254,
}  # fmt: skip
CONTEXT = ";#3=(PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.));#4=(GLOBAL_UNIT_ASSIGNED_CONTEXT((#3,#1)));"


@pytest.mark.parametrize(("records", "metres"), UNIT_RECORDS.items())
def test_length_unit_of_the_file(records: str, metres: float, caplog: pytest.LogCaptureFixture) -> None:
    assert step.parse_length_unit(Path("a.step"), records + CONTEXT) == pytest.approx(metres, rel=1e-12)
    assert not caplog.records


@pytest.mark.parametrize(
    "records",
    [
        "",
        "#1=(LENGTH_UNIT()CONVERSION_BASED_UNIT('LOOP',#2));#2=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(2.),#1)",
        "#1=(LENGTH_UNIT()CONVERSION_BASED_UNIT('NIL',#2));#2=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(0.),#5);"
        "#5=(LENGTH_UNIT()SI_UNIT($,.METRE.))",
        "#1=(LENGTH_UNIT()SI_UNIT(.SMALL.,.METRE.))",
    ],
)
def test_no_length_unit_means_millimetres_and_is_said(records: str, caplog: pytest.LogCaptureFixture) -> None:
    assert step.parse_length_unit(Path("a.step"), records + CONTEXT) == 1e-3
    assert "no length unit found" in caplog.text


def test_of_several_units_the_one_used_most(caplog: pytest.LogCaptureFixture) -> None:
    units = "#1=(LENGTH_UNIT()SI_UNIT($,.METRE.));#2=(LENGTH_UNIT()SI_UNIT(.MILLI.,.METRE.));"
    contexts = "".join(f"#{9 + i}=(GLOBAL_UNIT_ASSIGNED_CONTEXT((#{unit})));" for i, unit in enumerate((1, 2, 2)))
    assert step.parse_length_unit(Path("a.step"), units + contexts) == 1e-3
    assert "several length units" in caplog.text


def test_welding_drops_degenerate_faces_with_their_patches() -> None:
    box = trimesh.creation.box()
    vertices, faces = box.vertices[box.faces].reshape(-1, 3), np.arange(36).reshape(-1, 3)
    vertices, faces = np.vstack([vertices, vertices[:3]]), np.insert(faces, 5, [0, 36, 7], axis=0)
    patches = np.insert(np.arange(12), 5, 5)
    welded, triangles, kept = step.weld(np.array(vertices), faces, patches)
    assert len(welded) == 8
    assert kept.tolist() == list(range(12))
    np.testing.assert_array_equal(welded[triangles], box.vertices[box.faces])


def test_welding_keeps_bodies_apart_that_coincide() -> None:
    box = trimesh.creation.box()
    vertices = np.vstack([box.vertices[box.faces].reshape(-1, 3)] * 3)
    welded, triangles, _ = step.weld(vertices, np.arange(108).reshape(-1, 3), np.repeat(np.arange(18), 2))
    assert len(welded) == 24
    assert solid(welded, triangles).body_count == 3
    assert solid(welded, triangles).is_watertight


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
