"""Every mistake on the command line is one line that names the value and the fix, and leaves nothing behind."""

import os
import pickle
from pathlib import Path

import numpy as np
import pytest
import trimesh
from command_line import assert_one_line_error, call, train

from jointsdf.training.module import JointSDFModule

pytestmark = pytest.mark.filterwarnings("default")
BOX_FACES = 12


@pytest.mark.parametrize(
    ("override", "named"),
    [
        ("seed=-1", ["seed=-1", "at least 0"]),
        ("seed=1.5", ["seed=1.5", "an integer"]),
        ("resume=sometimes", ["resume=sometimes", "auto, never"]),
        ("force=maybe", ["force=maybe", "true, false"]),
        ("variant=../up", ["variant=../up", "without /"]),
        ("shape=part_1", ["part_1", "part_01"]),
        ("shape=abc_001", ["abc_001", "abc_0001"]),
        ("shape=nowhere.stl", ["nowhere.stl", "not found"]),
        ("labels=nowhere.npy", ["nowhere.npy", "not found"]),
        ("labels=brp", ["brp", "brep"]),
        ("labels=partfield", ["partfield_dir=", "github.com/nv-tlabs/PartField"]),
        ("num_parts=1", ["num_parts=1", "at least 2"]),
        ("num_parts=2.5", ["num_parts=2.5", "an integer"]),
        ("num_parts=many", ["num_parts=many", "an integer"]),
        ("num_parts=3", ["num_parts=3", "part_01 has its own labels", "labels=geometric"]),
        ("labels=none", ["part_01", "labels=", "head=none"]),
        ("paths.abc_missing=perhaps", ["perhaps", "fallback, error"]),
        ("data.counts.manifold=-5", ["data.counts.manifold=-5", "at least 1"]),
        ("data.counts.shell=0", ["data.counts.shell=0", "at least 1"]),
        ("data.counts.pool=many", ["data.counts.pool=many", "an integer"]),
        ("data.counts.balanced=2", ["data.counts.balanced=2", "0 to 1"]),
        ("data.cloud_size=0", ["data.cloud_size=0", "at least 100"]),
        ("data.pool_size=-1", ["data.pool_size=-1", "at least 1"]),
        ("data.label_fraction=2", ["data.label_fraction=2", "0 to 1"]),
        ("data.workers=-1", ["data.workers=-1", "0 to"]),
        ("trainer.max_steps=0", ["trainer.max_steps=0", "at least 1"]),
        ("trainer.max_steps=-5", ["trainer.max_steps=-5", "at least 1"]),
        ("trainer.max_steps=long", ["trainer.max_steps=long", "an integer"]),
        ("trainer.max_steps=null", ["trainer.max_steps=None", "an integer"]),
        ("trainer.clip=0", ["trainer.clip=0"]),
        ("trainer.clip=nan", ["trainer.clip=nan"]),
        ("trainer.warmup=7", ["trainer.warmup=7", "0 to 1"]),
        ("trainer.log_every=0", ["trainer.log_every=0", "at least 1"]),
        ("trainer.accelerator=tpu9", ["trainer.accelerator=tpu9", "auto, cpu, gpu"]),
        ("trainer.head_lr=-1", ["trainer.head_lr=-1"]),
        ("trunk.tap=9", ["trunk.tap=9", "1..5"]),
        ("trunk.init=cube", ["trunk.init=cube", "siren, sphere"]),
        ("trunk.width=0", ["trunk.width=0", "from 1 to"]),
        ("head.widths=[256]", ["head"]),
        ("head.omega=fast", ["omega"]),
        ("loss.weights.eikonal=-50", ["loss.weights.eikonal=-50", "at least 0"]),
        ("loss.weights.eikonal=heavy", ["loss.weights.eikonal=heavy", "a number"]),
        ("loss.terms.eikonal.form=cubed", ["eikonal.form=cubed", "squared, abs"]),
        ("loss.terms.eikonal.on=[mars]", ["eikonal.on=['mars']", "manifold"]),
        ("loss.terms.weingarten.derivative=guess", ["weingarten.derivative=guess", "exact"]),
        ("loss.terms.weingarten.spacing=0", ["weingarten.spacing=0"]),
        ("loss.schedules.weingarten.form=zigzag", ["schedule.form=zigzag", "linear"]),
        ("loss.terms.eikonal._target_=jointsdf.losses.nothing.Nothing", ["jointsdf.losses.nothing"]),
        ("optimizer.lr=-1", ["optimizer.lr=-1"]),
        ("optimizer.momentum=-3", ["momentum"]),
        ("extraction.resolution=3", ["extraction.resolution=3", "8 to 1024"]),
        ("extraction.method=magic", ["extraction.method=magic", "sparse"]),
        ("extraction.chunk=0", ["extraction.chunk=0"]),
        ("evaluation.primary=best", ["evaluation.primary=best", "unit, flatcad"]),
        ("evaluation.protocols.unit.points=0", ["points=0"]),
        ("evaluation.protocols.unit.frame=mine", ["frame='mine'", "truth, own"]),
        ("paths.abc_root=${nothing}", ["nothing"]),
    ],
)
@pytest.mark.usefixtures("as_in_training")
def test_a_bad_value_is_one_line_and_leaves_nothing(tmp_path, override, named):
    answer = train(tmp_path / "out", override)
    assert_one_line_error(answer, *named)
    assert len(answer.lines) == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["head=relux"], ["relux", "relu"]),
        (["heed=relu"], ["heed"]),
        (["trainer.steps=3"], ["steps"]),
        (["recipe=slow"], ["slow", "fast"]),
        (["loss=papers"], ["papers", "paper"]),
    ],
)
def test_what_hydra_refuses_is_no_traceback(tmp_path, arguments, named):
    answer = call("train.py", f"paths.outputs={tmp_path / 'out'}", *arguments)
    assert answer.code == 1
    assert "Traceback" not in answer.text
    for name in named:
        assert name in answer.text
    assert not (tmp_path / "out").exists()


def truncated(path: Path, mesh: trimesh.Trimesh) -> None:
    data = mesh.export(file_type="ply")
    path.write_bytes(data[: len(data) // 2])


def with_vertex(value: float):
    def write(path: Path, mesh: trimesh.Trimesh) -> None:
        vertices = mesh.vertices.copy()
        vertices[3, 1] = value
        lines = [f"v {x} {y} {z}" for x, y, z in vertices] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.faces]
        path.with_suffix(".obj").write_text("\n".join(lines))

    return write


def flat(path: Path, mesh: trimesh.Trimesh) -> None:
    trimesh.Trimesh(mesh.vertices * [1, 1, 0], mesh.faces, process=False).export(path)


BAD_MESHES = {
    "missing": (lambda *_: None, "box.ply", "not found"),
    "empty": (lambda path, _: path.touch(), "box.ply", "is empty"),
    "truncated": (truncated, "box.ply", "export it again"),
    "unreadable": (lambda path, _: path.write_bytes(os.urandom(999)), "box.ply", "cannot be read as ply"),
    "a folder": (lambda path, _: path.mkdir(), "box.ply", "is a folder"),
    "nan": (with_vertex(np.nan), "box.obj", "NaN or infinite"),
    "infinite": (with_vertex(np.inf), "box.obj", "NaN or infinite"),
    "flat": (flat, "box.ply", "is flat"),
}


@pytest.mark.parametrize("case", BAD_MESHES)
def test_a_bad_mesh_is_one_line_and_leaves_nothing(tmp_path, case):
    write, name, named = BAD_MESHES[case]
    write(tmp_path / "box.ply", trimesh.creation.box((2, 3, 4)))
    answer = train(tmp_path / "out", f"shape={tmp_path / name}", "head=none")
    assert_one_line_error(answer, str(tmp_path / name), named)
    assert not (tmp_path / "out").exists()


BAD_LABELS = {
    "none wanted": (None, "no part labels"),
    "one part": (np.zeros(BOX_FACES, int), "only one part"),
    "wrong length": (np.arange(11), "has 11 labels, the mesh has 12 faces, 36 vertices"),
    "below -1": (np.arange(BOX_FACES) - 2, "holds -2"),
    "float": (np.arange(BOX_FACES) / 2, "holds 0.5"),
    "objects": (np.array([{}] * BOX_FACES, dtype=object), "pickled"),
}


@pytest.mark.parametrize("case", BAD_LABELS)
def test_bad_labels_are_one_line_and_leave_nothing(tmp_path, case):
    labels, named = BAD_LABELS[case]
    trimesh.creation.box((2, 3, 4)).export(tmp_path / "box.stl")
    given = ["labels=none"]
    if labels is not None:
        np.save(tmp_path / "mine.npy", labels, allow_pickle=True)
        given = [f"labels={tmp_path / 'mine.npy'}"]
    answer = train(tmp_path / "out", f"shape={tmp_path / 'box.stl'}", *given)
    assert_one_line_error(answer, named)
    assert not (tmp_path / "out").exists()


def test_a_label_file_that_is_a_pickle_is_never_run(tmp_path):
    class Bomb:
        def __reduce__(self):
            return Path.touch, (tmp_path / "exploded",)

    trimesh.creation.box((2, 3, 4)).export(tmp_path / "box.stl")
    (tmp_path / "mine.npy").write_bytes(pickle.dumps(Bomb()))
    answer = train(tmp_path / "out", f"shape={tmp_path / 'box.stl'}", f"labels={tmp_path / 'mine.npy'}")
    assert_one_line_error(answer, "mine.npy", "a Python pickle, which is never read")
    assert not (tmp_path / "exploded").exists()


def test_a_bug_is_not_hidden(tmp_path, monkeypatch):
    def broken(*_):
        raise RuntimeError("a bug of ours")

    monkeypatch.setattr(JointSDFModule, "training_step", broken)
    answer = train(tmp_path)
    assert answer.code == 1
    assert "a bug of ours" in answer.text
    assert not list(tmp_path.rglob("result.json"))
