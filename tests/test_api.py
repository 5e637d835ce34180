"""The library's face: shapes of every kind, a fit that leaves nothing behind, fields loaded again."""

import json
import logging
import os
import signal
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
from command_line import QUICK
from run_folders import row_of

import jointsdf
from jointsdf.shapes.builtin import BUILTINS
from jointsdf.training.module import JointSDFModule
from jointsdf.values import Unit

pytestmark = pytest.mark.filterwarnings("default")
SHORT = [*QUICK[1:], "trainer.preview_every=0"]
RING = trimesh.creation.annulus(r_min=3.0, r_max=4.0, height=2.0)


def quick(shape: object = "part_01", **options: object) -> jointsdf.FittedRun:
    return jointsdf.fit(shape, recipe="smoke", quiet=True, overrides=SHORT, **options)


def test_a_fit_gives_field_mesh_and_scores_and_leaves_no_file(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    shape = replace(jointsdf.load_shape("part_01", unit="in"), up="y")
    run = quick(shape, head="relu", seed=3)
    assert list(tmp_path.iterdir()) == []
    assert run.folder is None
    assert (run.row.head, run.row.seed, run.row.shape, run.row.recipe) == ("relu", 3, "part_01", "smoke")
    assert run.scores == run.row.scores["unit"]
    assert run.scores["cd_l1"] > 0
    assert len(run.mesh.faces) == run.row.counts["faces_pred"]
    assert (run.mesh.unit, run.mesh.up) == (Unit("in", 0.0254), "y")
    cell = 2.2 * run.field.normalisation.scale / 15
    found = run.field.query(run.mesh.vertices)
    assert np.median(np.abs(found.sdf)) < cell
    assert set(run.mesh.labels) <= set(run.field.part_ids.tolist())


def test_the_same_seed_gives_the_same_field_as_the_command_line(tmp_path) -> None:
    from command_line import PLACE, train

    assert train(tmp_path).code == 0
    theirs, ours = jointsdf.load_field(tmp_path / PLACE), quick().field
    for name, value in theirs.state_dict().items():
        assert torch.equal(value, ours.state_dict()[name]), name


def test_settings_of_the_process_are_put_back() -> None:
    torch.manual_seed(5)
    names = ("jointsdf", "lightning.pytorch", "lightning", "jointsdf.extraction.extractor")
    logger = {name: (logging.getLogger(name).level, list(logging.getLogger(name).handlers)) for name in names}
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    before = (torch.get_rng_state(), torch.get_num_threads(), torch.backends.mkldnn.matmul.fp32_precision)
    folder = os.getcwd()
    quick()
    assert torch.equal(torch.get_rng_state(), before[0])
    assert (torch.get_num_threads(), torch.backends.mkldnn.matmul.fp32_precision) == before[1:]
    assert {name: (logging.getLogger(name).level, list(logging.getLogger(name).handlers)) for name in names} == logger
    assert {number: signal.getsignal(number) for number in handlers} == handlers
    assert os.getcwd() == folder
    assert torch.is_grad_enabled()


def test_a_folder_is_kept_where_it_is_asked_for_and_a_finished_run_is_not_run_again(tmp_path, monkeypatch) -> None:
    out = tmp_path / "there"
    first = quick(out=out)
    assert first.folder == out
    assert {"result.json", "field.ckpt", "mesh.ply", "labels.npy", "config.yaml"} <= {p.name for p in out.iterdir()}
    monkeypatch.setattr(JointSDFModule, "training_step", lambda *_: pytest.fail("trained again"))
    again = quick(out=str(out))
    assert again.row == first.row
    np.testing.assert_array_equal(again.mesh.labels, first.mesh.labels)
    np.testing.assert_array_equal(again.mesh.vertices, first.mesh.vertices)
    with pytest.raises(jointsdf.InputError, match="holds another config"):
        quick(out=out, seed=1)


def test_ctrl_c_is_a_keyboard_interrupt_and_the_same_call_goes_on(tmp_path, monkeypatch) -> None:
    original = JointSDFModule.training_step

    def interrupted(self, samples, batch_idx):
        if self.global_step == 2:
            os.kill(os.getpid(), signal.SIGINT)
        return original(self, samples, batch_idx)

    with monkeypatch.context() as patch:
        patch.setattr(JointSDFModule, "training_step", interrupted)
        with pytest.raises(KeyboardInterrupt):
            quick(out=tmp_path / "run")
    assert (tmp_path / "run" / "last.ckpt").is_file()
    whole, halves = quick().field, quick(out=tmp_path / "run").field
    for name, value in whole.state_dict().items():
        assert torch.equal(value, halves.state_dict()[name]), name


def test_a_fit_runs_in_a_thread() -> None:
    """Where Python gives no signals, as in a server."""
    found: list[jointsdf.FittedRun] = []
    thread = threading.Thread(target=lambda: found.append(quick()))
    thread.start()
    thread.join()
    assert len(found) == 1


def test_shapes_of_names_files_and_arrays_are_the_same(tmp_path) -> None:
    part = BUILTINS["part_01"]()
    named = jointsdf.load_shape("part_01")
    arrays = jointsdf.load_shape(vertices=part.vertices, faces=part.faces, labels=part.labels, name="mine")
    np.testing.assert_array_equal(named.mesh.faces, arrays.mesh.faces)
    np.testing.assert_array_equal(named.mesh.vertices, arrays.mesh.vertices)
    assert (arrays.name, arrays.label_provider, arrays.watertight) == ("mine", "array", True)
    np.testing.assert_array_equal(arrays.mesh.labels, part.labels)
    RING.export(tmp_path / "ring.ply")
    of_file = jointsdf.load_shape(tmp_path / "ring.ply", num_parts=3)
    of_lists = jointsdf.load_shape(vertices=RING.vertices.tolist(), faces=RING.faces.tolist(), num_parts=3)
    assert of_file.label_provider == of_lists.label_provider == "geometric:k=3"
    np.testing.assert_array_equal(of_file.mesh.labels, of_lists.mesh.labels)
    assert of_lists.name.startswith("mesh-")


def test_labels_of_arrays_follow_the_faces_that_are_kept() -> None:
    faces = np.concatenate([RING.faces[:1], RING.faces, [[0, 0, 1]]])  # a repeated one and one without area
    labels = np.concatenate([[7], np.arange(len(RING.faces)), [9]])
    labels[1] = 8
    shape = jointsdf.load_shape(vertices=RING.vertices, faces=faces, labels=labels)
    assert shape.dropped == 2
    assert shape.mesh.labels.tolist() == [7, *range(1, len(RING.faces))]


@pytest.mark.usefixtures("as_in_training")
@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "give a name or a path, or else vertices= and faces="),
        ({"source": "part_01", "vertices": RING.vertices}, "give a name or a path, or else"),
        ({"vertices": RING.vertices}, "vertices= without faces="),
        ({"vertices": RING.vertices[:, :2], "faces": RING.faces}, "vertices of shape"),
        ({"vertices": [[0, 0], [1, 2, 3]], "faces": RING.faces}, "vertices: rows of different lengths"),
        ({"vertices": RING.vertices, "faces": RING.faces.astype(float)}, "faces of shape .* give integers"),
        ({"vertices": RING.vertices, "faces": RING.faces + 1}, "uses a vertex out of range"),
        ({"vertices": RING.vertices * np.nan, "faces": RING.faces}, "NaN or infinite"),
        ({"vertices": RING.vertices, "faces": RING.faces, "labels": [1, 2]}, "the array of labels has 2 labels"),
        ({"vertices": RING.vertices, "faces": RING.faces, "labels": "geometrik"}, "geometrik"),
        ({"source": "part_01", "labels": [1, 2]}, "is a provider or a label file"),
        ({"source": "nowhere.stl"}, "file not found: nowhere.stl"),
        ({"source": "part_1"}, "near names are"),
        ({"source": "part_01", "num_parts": 1}, "num_parts=1: give an integer, at least 2"),
        ({"vertices": RING.vertices, "faces": RING.faces, "num_parts": 1}, "num_parts=1: give an integer, at least 2"),
        ({"vertices": RING.vertices, "faces": RING.faces, "num_parts": 2.5}, "num_parts=2.5: give an integer"),
        ({"source": "abc_0001", "abc_root": "nowhere"}, "abc_0001"),
    ],
    ids=str,
)
def test_what_is_no_shape_is_one_line(given, message) -> None:
    with pytest.raises(jointsdf.InputError, match=rf"^[^\n]*{message}[^\n]*$"):
        jointsdf.load_shape(**given)


@pytest.mark.usefixtures("as_in_training")
@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"recipe": "slow"}, "recipe=slow: accepted are fast, network, paper, points, raw_points, scan, smoke"),
        ({"head": "relux"}, "head=relux: accepted are deep_skip, hybrid, none, relu, siren"),
        ({"seed": -1}, "seed=-1"),
        ({"overrides": ["trainer.steps=3"]}, "steps"),
        ({"overrides": ["trainer.max_steps=0"]}, "trainer.max_steps=0: give an integer, at least 1"),
        ({"shape": "part_99"}, "unknown shape 'part_99'"),
        ({"overrides": ["reuse=true"]}, "reuse=true: the row of another study holds no field"),
        ({"shape": jointsdf.load_shape("part_01", labels="none")}, "has no part labels"),
    ],
    ids=str,
)
def test_what_cannot_be_fitted_is_one_line(given, message) -> None:
    with pytest.raises(jointsdf.InputError, match=rf"^[^\n]*{message}[^\n]*$"):
        jointsdf.fit(**{"shape": "part_01", "quiet": True} | given)


@pytest.mark.parametrize("given", [Path, str])
def test_a_field_is_loaded_by_its_file_or_folder(tmp_path, given) -> None:
    run = quick(head="none", out=tmp_path / "run")
    for path in (tmp_path / "run", tmp_path / "run" / "field.ckpt"):
        loaded = jointsdf.load_field(given(path))
        assert loaded.query([0.0, 0.0, 0.0], what="sdf").sdf == run.field.query([0.0, 0.0, 0.0], what="sdf").sdf
    with pytest.raises(jointsdf.InputError, match="no such field checkpoint"):
        jointsdf.load_field(given(tmp_path / "nowhere"))


def test_importing_the_package_is_light_and_changes_nothing() -> None:
    code = (
        "import sys, logging, jointsdf; "
        "assert not {'torch', 'numpy', 'lightning', 'hydra'} & set(sys.modules), 'heavy'; "
        "assert not logging.getLogger().handlers; "
        "assert {'fit', 'load_shape', 'load_field', '__version__'} <= set(dir(jointsdf)); "
        "print(jointsdf.__version__)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == jointsdf.__version__
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = jointsdf.nothing


def test_labels_of_the_overrides_count_for_a_shape_by_name() -> None:
    run = jointsdf.fit("part_01", recipe="smoke", quiet=True, overrides=[*SHORT, "labels=geometric", "num_parts=3"])
    assert (run.row.num_parts, run.row.provenance["label_provider"]) == (3, "geometric:k=3")
    assert run.field.part_ids.tolist() == [0, 1, 2]


def test_a_finished_run_without_a_surface_is_given_back(tmp_path) -> None:
    flat = jointsdf.fit("part_01", recipe="smoke", quiet=True, out=tmp_path / "run", overrides=SHORT)
    row = row_of(tmp_path / "run") | {"status": "empty_mesh"}
    (tmp_path / "run" / "result.json").write_text(json.dumps(row))
    again = jointsdf.fit("part_01", recipe="smoke", quiet=True, out=tmp_path / "run", overrides=SHORT)
    assert again.mesh.is_empty
    assert torch.equal(again.field.trunk.output.weight, flat.field.trunk.output.weight)
