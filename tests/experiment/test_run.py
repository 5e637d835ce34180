"""What a run leaves behind, when it refuses to run, and that it can be measured again."""

import json
import math
import shutil
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
import yaml
from command_line import PLACE, call, finished, train
from PIL import Image
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from jointsdf.data.point_cloud import Cloud
from jointsdf.experiment import run as experiment
from jointsdf.losses.dirichlet import Dirichlet
from jointsdf.model.field import JointField
from jointsdf.shapes.builtin import BUILTINS
from jointsdf.study.__main__ import main as study

pytestmark = pytest.mark.filterwarnings("default")
FILES = {"config.yaml", "field.ckpt", "labels.npy", "mesh.glb", "mesh.ply", "preview.png", "result.json", "tb"}
TERMS = ("dirichlet", "sign_agnostic", "eikonal", "signed_distance", "cross_entropy", "total")


def contents(folder: Path) -> dict[Path, tuple[int, bytes]]:
    return {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in folder.rglob("*") if path.is_file()}


def own_copy(tmp_path: Path) -> Path:
    """A finished run that a test may damage, below tmp_path as outputs folder."""
    return Path(shutil.copytree(finished(), tmp_path / PLACE))


def row_of(folder: Path) -> dict:
    return json.loads((folder / "result.json").read_text())


def test_a_run_leaves_these_files_and_no_others():
    assert {path.name for path in finished().iterdir()} == FILES
    outputs = finished().parents[len(PLACE.parts) - 1]
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


def test_the_field_answers_in_file_units():
    """Its zero is the mesh file's surface, and over a step in file units it changes by the step times its gradient."""
    field = JointField.load(finished() / "field.ckpt").double()
    mesh = trimesh.load(finished() / "mesh.ply", process=False)
    vertices = torch.as_tensor(mesh.vertices)
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


def test_tensorboard_shows_everything():
    board = EventAccumulator(str(finished() / "tb"), {"images": 0, "tensors": 0, "scalars": 0})
    board.Reload()
    tags = board.Tags()
    for term in TERMS:
        assert [event.step for event in board.Scalars(f"loss/{term}")] == [0, 1, 2, 3], term
        assert all(math.isfinite(event.value) for event in board.Scalars(f"loss/{term}"))
    rates = [tag for tag in tags["scalars"] if tag.startswith("lr-")]
    assert sorted(tag.rpartition("/")[2] for tag in rates) == ["head", "hidden", "trunk"]
    assert all(len(board.Scalars(tag)) == 4 for tag in rates)
    for part in ("trunk", "head"):
        assert len(board.Scalars(f"gradient_norm/{part}")) == 4
    for column in ("cd_l1", "nc", "miou"):
        assert [event.step for event in board.Scalars(f"preview_12/{column}")] == [2]
    assert [event.step for event in board.Images("preview_12/truth_and_prediction")] == [2]
    assert [event.step for event in board.Images("result/truth_and_prediction")] == [4]
    assert any(tag.startswith("result/mesh") for tag in tags["tensors"])
    scores = row_of(finished())["scores"]["unit"]
    for name, value in scores.items():
        assert [event.value for event in board.Scalars(f"result/{name}")] == [pytest.approx(value)], name


def test_hparams_are_in_the_same_log():
    board = EventAccumulator(str(finished() / "tb"))
    board.Reload()
    assert board.PluginTagToContent("hparams").keys() == {
        "_hparams_/experiment",
        "_hparams_/session_start_info",
        "_hparams_/session_end_info",
    }
    assert not [path for path in (finished() / "tb").iterdir() if path.is_dir()]


def test_the_same_command_gives_the_row_at_once_and_touches_nothing(tmp_path):
    folder = own_copy(tmp_path)
    before = contents(tmp_path)
    answer = train(tmp_path, "trainer.preview_every=2")
    assert answer.code == 0
    assert "holds this run's result already; force=true runs it again" in answer.lines[0]
    assert contents(tmp_path) == before
    for where_and_how in ("trainer.log_every=7", "data.workers=1", "trainer.checkpoint_seconds=3", "resume=never"):
        assert train(tmp_path, where_and_how).code == 0
        assert contents(tmp_path) == before, where_and_how
    assert folder.is_dir()


def test_another_config_is_refused_and_the_keys_are_listed(tmp_path):
    own_copy(tmp_path)
    before = contents(tmp_path)
    answer = train(tmp_path, "trainer.clip=3", "loss.weights.eikonal=7")
    assert answer.code == 2
    (line,) = answer.lines
    assert "holds another config: loss.weights.eikonal (50.0 -> 7.0), trainer.clip (10.0 -> 3.0)" in line
    assert "variant=<name>" in line
    assert "force=true" in line
    assert contents(tmp_path) == before


def test_force_and_variant_are_the_ways_out(tmp_path):
    folder = own_copy(tmp_path)
    assert train(tmp_path, "trainer.clip=3", "variant='clip=3'").code == 0
    assert (tmp_path / "smoke/clip=3/siren/part_01/seed0/result.json").is_file()
    assert row_of(folder) == row_of(finished())
    (folder / "stale").touch()
    assert train(tmp_path, "trainer.clip=3", "force=true").code == 0
    assert yaml.safe_load((folder / "config.yaml").read_text())["trainer"]["clip"] == 3
    assert {path.name for path in folder.iterdir()} == FILES
    assert row_of(folder)["provenance"]["config_hash"] != row_of(finished())["provenance"]["config_hash"]


def test_other_labels_of_the_same_mesh_are_another_run(tmp_path):
    own_copy(tmp_path)
    np.save(tmp_path / "other.npy", np.arange(len(BUILTINS["part_01"]().faces)) % 3)
    answer = train(tmp_path, f"labels={tmp_path / 'other.npy'}")
    assert answer.code == 2
    assert "holds another config: shape.labels_sha256" in answer.text


@pytest.mark.parametrize(
    ("name", "text", "named"),
    [
        ("config.yaml", "seed: [0", "force=true"),
        ("config.yaml", "", "force=true"),
        ("config.yaml", None, "force=true"),
    ],
)
def test_a_damaged_folder_is_one_line_with_the_fix(tmp_path, name, text, named):
    folder = own_copy(tmp_path)
    (folder / name).unlink() if text is None else (folder / name).write_text(text)
    answer = train(tmp_path)
    assert answer.code == 2
    (line,) = answer.lines
    assert line.startswith("error: ")
    assert str(folder) in line
    assert named in line


@pytest.mark.parametrize("text", ['{"schema": 1, "study"', "", "[1, 2]"])
def test_a_damaged_result_is_reported_and_the_run_done_again(tmp_path, text):
    folder = own_copy(tmp_path)
    (folder / "result.json").write_text(text)
    answer = train(tmp_path, "trainer.preview_every=2")
    assert answer.code == 0, answer.text
    assert answer.text.count("the run is done again") == 1
    assert f"{folder / 'result.json'}: not a readable result row" in answer.text
    assert row_of(folder)["scores"] == row_of(finished())["scores"]


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9, None])
def test_a_damaged_checkpoint_is_one_line_with_the_fix(tmp_path, share):
    folder = own_copy(tmp_path)
    (folder / "result.json").unlink()
    whole = (folder / "field.ckpt").read_bytes()  # whole, but not a checkpoint of the training
    (folder / "last.ckpt").write_bytes(whole if share is None else whole[: int(share * len(whole))])
    answer = train(tmp_path)
    assert answer.code == 2
    assert "last.ckpt: damaged checkpoint; resume=never starts the fit over" in answer.lines[-1]
    assert not (folder / "result.json").exists()
    assert train(tmp_path, "resume=never").code == 0
    assert row_of(folder)["scores"] == row_of(finished())["scores"]


def test_a_checkpoint_of_another_number_of_parts_is_refused(tmp_path):
    folder = own_copy(tmp_path)
    (folder / "result.json").unlink()
    state = {f"field.{name}": value for name, value in torch.load(folder / "field.ckpt")["state"].items()}
    state["field.part_ids"] = torch.arange(9)
    torch.save({"state_dict": state, "global_step": 2}, folder / "last.ckpt")
    answer = train(tmp_path)
    assert answer.code == 2
    assert "checkpoint of another field (field.part_ids is (9,), not (6,)); resume=never" in answer.lines[-1]


def test_a_loss_that_is_not_finite_stops_with_its_name_and_step(tmp_path, monkeypatch):
    original, calls = Dirichlet.__call__, []

    def broken(self, step):
        calls.append(1)
        return original(self, step) * (math.nan if len(calls) == 3 else 1.0)

    monkeypatch.setattr(Dirichlet, "__call__", broken)
    answer = train(tmp_path, "trainer.checkpoint_seconds=0")
    assert answer.code == 2
    assert answer.lines[-1].startswith("error: loss term dirichlet is nan at step 2: ")
    assert not list(tmp_path.rglob("result.json"))
    kept = torch.load(tmp_path / PLACE / "last.ckpt", weights_only=True)
    assert kept["global_step"] == 2
    assert all(torch.isfinite(value).all() for value in kept["state_dict"].values() if value.is_floating_point())


def test_a_rate_that_is_far_too_high_is_one_line(tmp_path):
    answer = train(tmp_path, "optimizer=adam", "optimizer.lr=1e6", "trainer.cosine=false")
    assert answer.code == 2
    assert "at step 1: lower the learning rate" in answer.lines[-1]
    assert answer.lines[-1].startswith("error: ")
    assert not list(tmp_path.rglob("last.ckpt"))
    assert train(tmp_path).code == 0, "a folder without a checkpoint is free for another config"


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


def stored_scores(text: str) -> dict[tuple[str, str], str]:
    words = [line.split() for line in text.splitlines()]
    return {(line[0], line[1]): line[2] for line in words if len(line) == 3}


def test_measured_again_it_gives_the_same_numbers():
    answer = call("evaluate.py", f"run={finished()}")
    assert answer.code == 0
    assert answer.lines[-1].endswith("every score as stored")
    scores = row_of(finished())["scores"]
    printed = stored_scores(answer.text)
    assert len(printed) == sum(len(values) for values in scores.values())
    assert printed["unit", "cd_l1"] == f"{scores['unit']['cd_l1']:.6f}"


def test_settings_have_one_hash_whatever_the_shape_and_head(tmp_path):
    hashes = {}
    for name, settings in {"a": ["head=siren"], "b": ["head=none", "seed=3"], "c": ["data.label_fraction=0.5"]}.items():
        assert train(tmp_path / name, *settings).code == 0
        (path,) = (tmp_path / name).rglob("result.json")
        hashes[name] = json.loads(path.read_text())["provenance"]["settings_hash"]
    assert hashes["a"] == hashes["b"] != hashes["c"]


def test_measured_again_it_multiplies_matrices_as_the_run_did(monkeypatch):
    asked: list[str] = []
    monkeypatch.setattr(experiment, "use_matmul", asked.append)
    assert call("evaluate.py", f"run={finished()}").code == 0
    assert asked == [row_of(finished())["provenance"]["matmul"]]


def test_a_number_that_differs_is_shown(tmp_path):
    folder = own_copy(tmp_path)
    row = row_of(folder)
    row["scores"]["unit"]["nc"] += 1e-12
    (folder / "result.json").write_text(json.dumps(row))
    answer = call("evaluate.py", f"run={folder}")
    assert answer.lines[-1].endswith("1 scores differ")


@pytest.fixture
def box(tmp_path, monkeypatch):
    """A relative path to a mesh with labels in the working directory."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in").mkdir()
    mesh = trimesh.creation.box((2, 3, 4))
    mesh.export(tmp_path / "in/box.stl")
    np.save(tmp_path / "in/parts.npy", np.arange(len(mesh.faces)) // 6)
    return ["shape=in/box.stl", "labels=in/parts.npy"]


def test_measured_again_from_another_working_directory(tmp_path, monkeypatch, box):
    assert train("outputs", *box).code == 0
    (folder,) = (path.parent for path in tmp_path.rglob("result.json"))
    assert folder.parent.name.startswith("box-")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    answer = call("evaluate.py", f"run={folder}")
    assert answer.code == 0, answer.text
    assert answer.lines[-1].endswith("every score as stored")
    relative = call("evaluate.py", f"run=../{folder.relative_to(tmp_path)}")
    assert relative.lines[-1].endswith("every score as stored")


def test_a_ground_truth_that_changed_is_an_error(tmp_path, box):
    assert train("outputs", *box).code == 0
    (folder,) = (path.parent for path in tmp_path.rglob("result.json"))
    np.save(tmp_path / "in/parts.npy", np.arange(12) // 3)
    answer = call("evaluate.py", f"run={folder}")
    assert answer.code == 2
    assert "its ground truth is not there any more: labels_sha256" in answer.lines[-1]
    (tmp_path / "in/box.stl").unlink()
    answer = call("evaluate.py", f"run={folder}")
    assert answer.code == 2
    assert "box.stl" in answer.lines[-1]


@pytest.mark.parametrize(
    ("damage", "named"),
    [
        (lambda folder: shutil.rmtree(folder), "not a run folder"),
        (lambda folder: (folder / "config.yaml").unlink(), "not a run folder"),
        (lambda folder: (folder / "result.json").unlink(), "no finished run"),
        (lambda folder: (folder / "field.ckpt").unlink(), "no such field checkpoint"),
        (lambda folder: (folder / "field.ckpt").write_bytes(b"PK\x03\x04"), "not a readable field checkpoint"),
        (lambda folder: (folder / "config.yaml").write_text("identity: {shape: {}}"), "config.yaml: damaged"),
    ],
)
def test_what_is_no_finished_run_is_one_line(tmp_path, damage, named):
    folder = own_copy(tmp_path)
    damage(folder)
    answer = call("evaluate.py", f"run={folder}")
    assert answer.code == 2
    (line,) = answer.lines
    assert line.startswith("error: ")
    assert named in line


def test_evaluate_without_a_run_is_one_line():
    answer = call("evaluate.py")
    assert answer.code == 2
    assert answer.lines == [
        "error: run= is missing; give a finished run's folder: run=outputs/fast/base/siren/part_01/seed0"
    ]


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
