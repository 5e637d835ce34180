"""Files and result row of a run."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
from command_line import FILES, PLACE, finished, train
from PIL import Image
from run_folders import OUTPUTS_LEVEL, row_of

from jointsdf.data.point_cloud import Cloud
from jointsdf.model.field import JointField
from jointsdf.shapes.builtin import BUILTINS
from jointsdf.shapes.readers.mesh_file import read_mesh
from jointsdf.study.__main__ import main as study
from jointsdf.values import BOX, Unit
from jointsdf.viewing.part_mesh import PartMesh

pytestmark = pytest.mark.filterwarnings("default")


def test_a_run_leaves_these_files_and_no_others():
    assert {path.name for path in finished().iterdir()} == FILES
    outputs = finished().parents[OUTPUTS_LEVEL]
    assert [path.relative_to(outputs) for path in outputs.rglob("result.json")] == [PLACE / "result.json"]
    assert not list(outputs.rglob("*.tmp")) + list(outputs.rglob("*.part"))


def test_the_row_says_everything():
    row = row_of(finished())
    assert (row["study"], row["variant"], row["recipe"], row["head"]) == ("smoke", "base", "smoke", "siren")
    assert (row["shape"], row["seed"], row["status"], row["steps"], row["num_parts"]) == ("part_01", 0, "ok", 4, 6)
    sizes = {"faces_gt", "faces_pred", "vertices_pred", "parameters_trunk", "parameters_head"}
    assert row["counts"].keys() == sizes | {"components_gt", "flipped_gt", "dropped_gt"}
    assert row["counts"]["parameters_trunk"] == 264_449
    stages = {"load", "prepare", "fit", "extract", "evaluate", "picture"}
    assert row["seconds"].keys() == stages | {"total"}
    assert row["seconds"]["total"] == pytest.approx(sum(row["seconds"][stage] for stage in stages), abs=0.01)
    assert row["peak_memory_mb"] > 50
    assert row["scores"].keys() == {"unit", "flatcad"}
    wanted = {"cd_l1", "cd_l2", "nc", "f1", "miou", "acc", "consistency", "parts_pred", "parts_gt"}
    wanted |= {f"iou_{k}" for k in range(6)} | {"components", "euler", "volume", "volume_gt"}
    wanted |= {"surface_mean", "surface_p99", "surface_max", "miou_exact", "acc_exact", "boundary_f1"}
    wanted |= {f"{name}_floor" for name in ("cd_l1", "nc", "f1", "miou", "acc", "consistency")}
    wanted |= {f"{name}_ceiling" for name in ("miou_exact", "acc_exact", "boundary_f1")}
    for scores in row["scores"].values():
        assert wanted <= scores.keys()
        assert all(scores[name] is not None for name in wanted)


def test_the_row_says_where_it_comes_from():
    provenance = row_of(finished())["provenance"]
    named = {"matmul", "backward", "orthogonalisation", "threads", "kind"}
    named |= {"commit", "config_hash", "versions", "device", "mesh_sha256", "label_provider", "resolution", "date"}
    assert named <= provenance.keys()
    assert (provenance["device"], provenance["label_provider"], provenance["resolution"]) == ("cpu", "builtin", 16)
    assert provenance["versions"]["torch"] == torch.__version__
    assert len(provenance["mesh_sha256"]) == 64
    assert (provenance["watertight"], provenance["inside_solid"], provenance["near_contact"]) == (True, 0.0, 0.0)
    assert 0 < provenance["thinnest_wall"] < provenance["grid_cell"], "16 points along an axis are too few"


def test_settings_have_one_hash_whatever_the_shape_and_head(tmp_path):
    hashes = {}
    for name, settings in {"a": ["head=siren"], "b": ["head=none", "seed=3"], "c": ["data.label_fraction=0.5"]}.items():
        assert train(tmp_path / name, *settings).code == 0
        (path,) = (tmp_path / name).rglob("result.json")
        hashes[name] = json.loads(path.read_text())["provenance"]["settings_hash"]
    assert hashes["a"] == hashes["b"] != hashes["c"]


def test_the_mesh_is_reported_before_the_fit(tmp_path: Path) -> None:
    answer = train(tmp_path, "labels=geometric", "num_parts=3", "loss.weights.eikonal=-1")
    assert "thinnest wall" not in answer.text, "not before the config is known to be right"
    answer = train(tmp_path, "labels=geometric", "num_parts=3")
    assert answer.code == 0, answer.text
    assert "part_01: 2940 faces, 1 component, watertight" in answer.text
    assert "give extraction.resolution=" in answer.text
    row = row_of(tmp_path / PLACE)
    assert (row["num_parts"], row["provenance"]["label_provider"]) == (3, "geometric:k=3")
    again = train(tmp_path, "labels=geometric", "num_parts=4")
    assert again.code == 2
    assert "holds another config: shape.labels_sha256" in again.text


def test_the_mesh_files_agree():
    labels = np.load(finished() / "labels.npy")
    mesh = trimesh.load(finished() / "mesh.ply", process=False)
    assert labels.dtype == np.int64
    assert len(labels) == len(mesh.faces) == row_of(finished())["counts"]["faces_pred"]
    np.testing.assert_array_equal(mesh.metadata["_ply_raw"]["face"]["data"]["label"], labels)
    assert set(labels) <= set(range(6))
    assert len(trimesh.load_scene(finished() / "mesh.glb").geometry) == len(set(labels))
    truth = BUILTINS["part_01"]().vertices
    size = np.ptp(truth, axis=0).max()
    assert (mesh.vertices > truth.min(axis=0) - 0.7 * size).all()
    assert (mesh.vertices < truth.max(axis=0) + 0.7 * size).all()


def test_unit_and_axis_of_the_shape_go_through_the_run(tmp_path):
    ring = trimesh.creation.annulus(r_min=3.0, r_max=4.0, height=2.0)
    given = PartMesh(ring.vertices, ring.faces, (ring.face_normals[:, 2] > 0.5).astype(int), up="y")
    given.export(tmp_path / "ring.ply")
    shape = f"shape={tmp_path / 'ring.ply'}", f"labels={tmp_path / 'ring.ply'}"
    answer = train(tmp_path / "runs", *shape, "unit=inch")
    (path,) = (tmp_path / "runs").rglob("result.json")
    provenance = row_of(path.parent)["provenance"]
    assert (provenance["unit"], provenance["unit_known"]) == ("in", True)
    for name in ("mesh.ply", "mesh.glb"):
        written = read_mesh(path.with_name(name))
        assert (written.unit, written.up) == (Unit("in", 0.0254), "y")
    lengths = (r"unit in\n", r"thinnest wall [\d.]+ in,", r"wall \([\d.]+ in\)", r"cells of the grid \(of [\d.]+ in\)")
    for length in (*lengths, r"is within [\d.]+ in of the part"):
        assert re.search(length, answer.text), answer.text


def test_the_field_answers_in_file_units():
    """Its zero is the mesh file's surface, and over a step in file units it changes by the step times its gradient."""
    field = JointField.load(finished() / "field.ckpt").double()
    mesh = trimesh.load(finished() / "mesh.ply", process=False)
    within = (np.abs(field.normalisation.forward(mesh.vertices)) < 0.999 * BOX).all(axis=1)  # outside is a bound
    vertices = torch.as_tensor(mesh.vertices[within])
    found = field.query(vertices)
    side = np.ptp(BUILTINS["part_01"]().vertices, axis=0).max()
    step = 1e-5 * side * torch.nn.functional.normalize(torch.randn(vertices.shape, dtype=torch.float64), dim=1)
    change = field.query(vertices + step).sdf - field.query(vertices - step).sdf
    torch.testing.assert_close(change, 2 * (found.gradient * step).sum(1), rtol=1e-3, atol=1e-6 * side)
    cell = 2.2 * field.normalisation.scale / 15
    assert found.sdf.abs().median() < 0.1 * cell * found.gradient.norm(dim=1).median()
    cloud = Cloud.of(BUILTINS["part_01"](), count=1000, seed=0)
    assert field.normalisation.scale == pytest.approx(cloud.normalisation.scale, rel=1e-12)
    np.testing.assert_allclose(field.normalisation.centre, cloud.normalisation.centre, rtol=1e-12)


def test_a_field_without_a_surface_is_a_row_that_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr(JointField, "network_sdf", lambda _, points: np.ones(len(points), dtype=np.float32))
    answer = train(tmp_path, "trainer.preview_every=2")
    assert answer.code == 0, answer.text
    assert "empty_mesh" in answer.lines[-1]
    folder, row = tmp_path / PLACE, row_of(tmp_path / PLACE)
    assert row["status"] == "empty_mesh"
    for scores in row["scores"].values():
        assert scores["cd_l1"] is None
        assert (scores["f1"], scores["miou"], scores["acc"]) == (0, 0, 0)
        assert scores["cd_l1_floor"] > 0
    assert b"element face 0" in (folder / "mesh.ply").read_bytes()
    assert len(np.load(folder / "labels.npy")) == 0
    assert np.array(Image.open(folder / "preview.png")).std() > 0
    assert study(["tables", str(tmp_path)]) == 0
    assert "empty_mesh" in next(tmp_path.rglob("runs.csv")).read_text()


@pytest.mark.parametrize("head", ["relu", "siren", "hybrid", "deep_skip", "none"])
def test_every_head_runs(tmp_path, head):
    answer = train(tmp_path, f"head={head}", "trainer.max_steps=3", "extraction.resolution=32")
    assert answer.code == 0, answer.text
    row = row_of(tmp_path / f"smoke/base/{head}/part_01/seed0")
    assert row["head"] == head
    assert (row["scores"]["unit"]["miou"] is None) == (head == "none")


def test_a_run_of_points_draws_its_cloud_once(tmp_path, monkeypatch) -> None:
    """Its area, its samples and its distances are those of one cloud."""
    drawn, original = [], Cloud.of.__func__

    def counted(cls, *args, **options):
        drawn.append(options["count"])
        return original(cls, *args, **options)

    monkeypatch.setattr(Cloud, "of", classmethod(counted))
    answer = train(tmp_path, "data.distances=cloud", "trainer.full_rate_area=6", "data.cloud_size=2000")
    assert answer.code == 0, answer.text
    assert drawn == [2000]
