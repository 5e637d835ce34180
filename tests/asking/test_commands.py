"""The commands that ask a finished run: the library's own answers, in files and file units; mistakes in one line."""

import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import trimesh
from asked_runs import FRAME, INCH, PARTS, RADIUS, ask
from PIL import Image

from jointsdf.asking import point_files
from jointsdf.asking.asked_run import open_run
from jointsdf.model.field import JointField
from jointsdf.shapes.readers.mesh_file import read_mesh

pytestmark = pytest.mark.filterwarnings("default")
EVERYTHING = "sdf,part,probabilities,gradient,closest,curvatures"


@pytest.fixture
def points(tmp_path: Path) -> np.ndarray:
    """A hundred points, three of them outside the training box, in a file."""
    made = FRAME.inverse(np.random.default_rng(0).uniform(-0.9, 0.9, (100, 3)))
    made[[5, 50, 99]] += 30
    np.save(tmp_path / "points.npy", made)
    return made


def test_a_query_writes_what_the_library_answers(
    run_folder: Path, field: JointField, points: np.ndarray, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog
) -> None:
    monkeypatch.setattr(point_files, "PIECE", 30)
    caplog.set_level("INFO")
    found = ask("query", run_folder, tmp_path / "points.npy", "--out", tmp_path / "a.npz", "--what", EVERYTHING)
    assert found.exit_code == 0, found.output
    with np.load(tmp_path / "a.npz") as archive:
        answers = dict(archive)
    with pytest.warns(UserWarning, match="outside the training box"):
        expected = field.query(points)
    np.testing.assert_array_equal(answers["points"], points)
    np.testing.assert_allclose(answers["sdf"], expected.sdf, atol=1e-5)
    np.testing.assert_array_equal(answers["part"], expected.part)
    np.testing.assert_allclose(answers["gradient"], expected.gradient, atol=1e-4)
    np.testing.assert_allclose(answers["probabilities"].sum(axis=1), 1, atol=1e-5)
    inside = expected.part >= 0
    np.testing.assert_array_equal(
        np.array(PARTS)[answers["probabilities"].argmax(axis=1)][inside], expected.part[inside]
    )
    on_surface = field.query(answers["closest"], what="sdf").sdf
    assert np.abs(on_surface).max() < 1e-3
    assert np.abs(np.linalg.norm(answers["closest"] - FRAME.centre, axis=1) - RADIUS).max() < 0.005 * RADIUS
    np.testing.assert_allclose(np.linalg.norm(answers["closest"] - points, axis=1), answers["distance"], rtol=1e-4)
    np.testing.assert_allclose(answers["curvatures"], field.curvatures(points).principal, rtol=1e-3, atol=1e-4)
    assert "3 points lie outside the training box" in caplog.text
    assert "100 points, unit in" in caplog.text


def test_answers_in_text_have_named_columns(run_folder: Path, points: np.ndarray, tmp_path: Path) -> None:
    words = ("query", run_folder / "field.ckpt", tmp_path / "points.npy", "--out", tmp_path / "a.csv")
    assert ask(*words, "--what", EVERYTHING).exit_code == 0
    table = pd.read_csv(tmp_path / "a.csv")
    names = "x y z sdf part p_3 p_40 gradient_x gradient_y gradient_z closest_x closest_y closest_z distance k1 k2"
    assert list(table.columns) == names.split()
    np.testing.assert_allclose(table[["x", "y", "z"]], points)
    assert ask(*words).exit_code == 0
    again = pd.read_csv(tmp_path / "a.csv")
    assert list(again.columns) == ["x", "y", "z", "sdf", "part", "gradient_x", "gradient_y", "gradient_z"]
    np.testing.assert_allclose(again["sdf"], table["sdf"])


def test_a_slice_is_a_picture_and_circles(run_folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "cut.png"
    assert ask("slice", run_folder, "--plane", "0,0,1,3.5", "--out", out, "--step", 1, "--raster", 100).exit_code == 0
    with Image.open(out) as picture:
        assert picture.size == (960, 960)
    table = pd.read_csv(tmp_path / "cut.csv")
    assert list(table.columns) == ["level", "line", "closed", "x", "y", "z"]
    surface = table[table["level"] == 0]
    assert set(surface["closed"]) == {1}
    radii = np.hypot(surface["x"] - FRAME.centre[0], surface["y"] - FRAME.centre[1])
    np.testing.assert_allclose(radii, RADIUS, rtol=0.005)
    np.testing.assert_allclose(surface["z"], 3.5)


@pytest.mark.parametrize(("suffix", "distance"), [("ply", 1.0), ("stl", -1.0), ("glb", 0.5), ("obj", 0)])
def test_an_offset_is_a_closed_ball(run_folder: Path, tmp_path: Path, suffix: str, distance: float) -> None:
    out = tmp_path / f"ball.{suffix}"
    found = ask("offset", run_folder, distance, "--out", out, "--resolution", 40)
    assert found.exit_code == 0, found.output
    mesh = trimesh.load(out, force="mesh")
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    size = mesh.extents.max() / (2 * (0.0254 if suffix == "glb" else 1))
    assert size == pytest.approx(RADIUS + distance, rel=0.01)
    assert mesh.is_watertight
    if suffix == "ply":
        read = read_mesh(out)
        assert set(read.columns["label"].values.tolist()) == set(PARTS)
        assert (read.unit, read.up) == (INCH, "y")


def test_measures_of_field_and_mesh_agree_and_are_written(run_folder: Path, tmp_path: Path) -> None:
    found = ask("measure", run_folder, "--out", tmp_path / "m.json", "--resolution", 64)
    assert found.exit_code == 0, found.output
    content = json.loads((tmp_path / "m.json").read_text())
    assert content["unit"] == "in"
    exact = 4 / 3 * np.pi * RADIUS**3
    for source in ("field", "mesh"):
        assert content[source]["volume"] == pytest.approx(exact, rel=0.01)
        np.testing.assert_allclose(content[source]["centre_of_mass"], FRAME.centre, atol=0.1)
    for name in ("volume", "area", "inertia"):
        np.testing.assert_allclose(content["field"][name], content["mesh"][name], rtol=0.01, atol=0.01 * exact)
    for part, each in content["field"]["parts"].items():
        assert each["area"] == pytest.approx(content["mesh"]["parts"][part]["area"], rel=0.02)
    assert [line.split()[0] for line in found.output.splitlines()[1:4]] == ["volume", "area", "centre"]
    assert f"{content['mesh']['volume']:.6g}" in found.output
    assert ask("measure", run_folder, "--out", tmp_path / "m.csv", "--resolution", 64).exit_code == 0
    table = pd.read_csv(tmp_path / "m.csv").set_index(["quantity", "source"])
    assert table.loc[("volume", "field"), "value"].item() == pytest.approx(content["field"]["volume"])
    assert table.loc[("part 40 area", "mesh"), "unit"] == "in^2"


@pytest.mark.parametrize("suffix", ["ply", "stl"])
def test_solids_of_parts_close_and_surfaces_of_parts_do_not(run_folder: Path, tmp_path: Path, suffix: str) -> None:
    copy = shutil.copytree(run_folder, tmp_path / "run")
    (copy / "parts").mkdir()
    (copy / "parts" / f"part_9.{suffix}").write_bytes(b"of a run before")
    found = ask("parts", copy, "--solid", "--format", suffix, "--cells", 24)
    assert found.exit_code == 0, found.output
    files = [copy / "parts" / f"part_{part}.{suffix}" for part in PARTS]
    assert sorted((copy / "parts").iterdir()) == files
    solids = [trimesh.load(path) for path in files]
    assert all(solid.is_watertight and solid.volume > 0 for solid in solids)
    whole = trimesh.load(copy / "mesh.ply").volume
    assert sum(solid.volume for solid in solids) == pytest.approx(whole, rel=1e-3)
    assert ask("parts", copy, "--format", suffix, "--out", tmp_path / "open").exit_code == 0
    surfaces = [trimesh.load(tmp_path / "open" / path.name) for path in files]
    assert not any(surface.is_watertight for surface in surfaces)
    assert sum(surface.area for surface in surfaces) == pytest.approx(trimesh.load(copy / "mesh.ply").area, rel=1e-5)


def test_a_field_file_alone_is_asked_in_assumed_units(run_folder: Path, tmp_path: Path) -> None:
    shutil.copy(run_folder / "field.ckpt", tmp_path / "mine.ckpt")
    alone, whole = open_run(str(tmp_path / "mine.ckpt")), open_run(str(run_folder / "field.ckpt"))
    assert (alone.folder, alone.unit.known, alone.resolution) == (None, False, 256)
    assert (whole.folder, whole.unit, whole.up, whole.resolution) == (run_folder, INCH, "y", 48)


def test_a_folder_of_a_stranger_runs_nothing(run_folder: Path, tmp_path: Path) -> None:
    """Its config is not read at all."""
    copy = shutil.copytree(run_folder, tmp_path / "run")
    (copy / "config.yaml").write_text("loss: {_target_: os.system, command: exit 1}")
    assert ask("measure", copy, "--resolution", 64).exit_code == 0
    (copy / "field.ckpt").write_bytes(b"\x80\x02cos\nsystem\nX\x06\x00\x00\x00exit 1\x85R.")
    found = ask("measure", copy)
    assert found.exit_code == 2


@pytest.mark.usefixtures("points")
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("query", "RUN", "none.csv", "--out", "a.csv"), "file not found"),
        (("query", "RUN", "points.npy", "--out", "a.xls"), "ends in csv, npy, npz, ply"),
        (("query", "RUN", "points.npy", "--out", "a.csv", "--what", "normal"), "--what normal: give some of sdf,part"),
        (("query", "nowhere", "points.npy", "--out", "a.csv"), "nowhere: no such folder or file"),
        (("query", "RUN", "points.npy", "--out", "points.npy/a.csv"), "give a file in a folder that can be written"),
        (("slice", "RUN", "--plane", "z=500"), "--plane z=500: outside the training box"),
        (("slice", "RUN", "--plane", "z=3", "--out", "a.jpg"), "ends in png"),
        (("slice", "RUN", "--plane", "z=3", "--step", "0"), "--step=0"),
        (("offset", "RUN", "50", "--out", "a.ply"), "offset 50: its surface leaves the training box; give less than"),
        (("offset", "RUN", "-50", "--out", "a.ply"), "offset -50: there is no surface"),
        (("offset", "RUN", "1", "--out", "a.step"), "format step is not written"),
        (("measure", "RUN", "--resolution", "100"), "resolution=100"),
        (("parts", "mine.ckpt", "--solid"), "--out is missing"),
    ],
)
def test_a_mistake_is_one_line_and_leaves_no_file(
    run_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog, words: tuple[str, ...], message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copy(run_folder / "field.ckpt", "mine.ckpt")
    before = sorted(tmp_path.iterdir())
    found = ask(*(run_folder if word == "RUN" else word for word in words))
    assert found.exit_code == 2, found.output
    (line,) = [record.getMessage() for record in caplog.records if record.levelname == "ERROR"]
    assert message in line
    assert "\n" not in line
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.usefixtures("points")
def test_ctrl_c_leaves_nothing(run_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("jointsdf.asking.questions.answer", interrupt)
    assert ask("query", run_folder, tmp_path / "points.npy", "--out", tmp_path / "a.npz").exit_code == 130
    assert "stopped; nothing is written" in caplog.text
    assert [path.name for path in tmp_path.iterdir()] == ["points.npy"]
