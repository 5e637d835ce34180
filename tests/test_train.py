"""What the command line says: quiet off a terminal, a bar on one, and one line for every mistake, never a traceback."""

import errno
import json
import os
import pickle
import pty
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from command_line import PLACE, QUICK, ROOT, call, train

from jointsdf.model.field import JointField
from jointsdf.runs import files
from jointsdf.shapes.builtin import BUILTINS
from jointsdf.training.module import JointSDFModule

pytestmark = pytest.mark.filterwarnings("default")
BOX_FACES = 12
PHASES = ("start", "load", "prepare", "fit", "extract", "measure", "draw")
SIDE = np.ptp(BUILTINS["part_01"]().vertices, axis=0).max()


def files_below(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())


def assert_one_line_error(answer, *named: str) -> None:
    """One line that names the value and the fix; warnings about the mesh may come before it."""
    assert answer.code == 2, answer.text
    assert "Traceback" not in answer.text
    errors = [line for line in answer.lines if line.startswith("error: ")]
    assert errors == answer.lines[-1:], answer.text
    for name in named:
        assert name in errors[0], errors[0]


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
        (["shape"], ["shape"]),
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
    "wrong length": (np.arange(11), "has 11 labels, the mesh file has 12 faces"),
    "below -1": (np.arange(BOX_FACES) - 2, "holds -2"),
    "float": (np.arange(BOX_FACES) / 2, "holds float64"),
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
    assert_one_line_error(answer, "mine.npy", "pickled")
    assert not (tmp_path / "exploded").exists()


def test_outputs_that_are_a_file_are_one_line(tmp_path):
    (tmp_path / "out").write_text("mine")
    assert_one_line_error(train(tmp_path / "out"), str(tmp_path / "out"), "paths.outputs=")
    assert (tmp_path / "out").read_text() == "mine"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_cannot_be_written_is_one_line(tmp_path):
    (tmp_path / "out").mkdir(mode=0o500)
    assert_one_line_error(train(tmp_path / "out"), str(tmp_path / "out"), "paths.outputs=")


def no_space(*_):
    raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize(
    ("module", "name"), [(files.os, "replace"), (files.os, "fsync"), (Path, "write_bytes")], ids=str
)
def test_a_full_disk_is_one_line_and_leaves_no_result(tmp_path, monkeypatch, module, name):
    with monkeypatch.context() as patch:
        patch.setattr(module, name, no_space)
        answer = train(tmp_path)
    assert_one_line_error(answer, "No space left on device", "the disk is full", "paths.outputs=")
    assert not list(tmp_path.rglob("result.json"))
    assert not list(tmp_path.rglob("*.tmp"))
    assert train(tmp_path).code == 0, "with space again, the same command goes on"


def test_a_field_that_cannot_be_written_is_one_line(tmp_path, monkeypatch):
    def save(*_):
        raise RuntimeError("[enforce fail at inline_container.cc:672] . unexpected pos 64 vs 0")

    monkeypatch.setattr(JointField, "save", save)
    assert_one_line_error(train(tmp_path), "field.ckpt", "the disk is full")
    assert not list(tmp_path.rglob("result.json"))


@pytest.fixture
def small_disk(tmp_path):
    """A file system of one MiB: less than a checkpoint."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = shutil.which("mount")
    if mount is None or subprocess.run([mount, "-t", "tmpfs", "-o", "size=1m", "tmpfs", disk], check=False).returncode:
        pytest.skip("no right to mount a small file system here")
    yield disk
    subprocess.run(["umount", "-l", disk], check=True)


def test_a_disk_that_is_really_full_is_one_line(small_disk):
    assert_one_line_error(train(small_disk), "the disk is full")
    assert not list(small_disk.rglob("result.json"))
    assert not list(small_disk.rglob("*.part"))


def test_a_bug_is_not_hidden(tmp_path, monkeypatch):
    def broken(*_):
        raise RuntimeError("a bug of ours")

    monkeypatch.setattr(JointSDFModule, "training_step", broken)
    answer = train(tmp_path)
    assert answer.code == 1
    assert "a bug of ours" in answer.text
    assert not list(tmp_path.rglob("result.json"))


def test_four_heads_are_four_rows_in_four_folders(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    answer = train("outputs", "-m", "head=relu,siren,hybrid,deep_skip")
    assert answer.code == 0, answer.text
    rows = [json.loads(path.read_text()) for path in tmp_path.rglob("result.json")]
    assert sorted(row["head"] for row in rows) == ["deep_skip", "hybrid", "relu", "siren"]
    assert [path.name for path in tmp_path.iterdir()] == ["outputs"]
    assert {path.name for path in (tmp_path / "outputs").iterdir()} <= {"smoke", ".hydra", ".companions"}
    assert not [path for path in tmp_path.rglob("*") if re.search(r"\d{4}-\d\d-\d\d|\d\d-\d\d-\d\d", path.name)]


def test_a_job_that_fails_does_not_stop_the_others(tmp_path):
    answer = train(tmp_path, "-m", "trunk.tap=9,3", "shape=part_01,part_99")
    assert answer.code == 1
    assert "Traceback" not in answer.text
    assert len([line for line in answer.lines if line.startswith("error: ")]) == 3
    assert [path.parent for path in tmp_path.rglob("result.json")] == [tmp_path / PLACE]


def test_a_missing_abc_shape_runs_under_the_name_of_what_it_is(tmp_path):
    absent = f"paths.abc_root={tmp_path / 'absent'}"
    answer = train(tmp_path / "out", "shape=abc_0001", absent)
    assert answer.code == 0
    assert "abc_0001 is not on this machine" in answer.lines[0]
    assert json.loads((tmp_path / "out" / PLACE / "result.json").read_text())["shape"] == "part_01"
    assert "abc_0001" not in " ".join(map(str, files_below(tmp_path / "out")))
    assert yaml.safe_load((tmp_path / "out" / PLACE / "config.yaml").read_text())["shape"] == "part_01"
    forbidden = train(tmp_path / "other", "shape=abc_0001", absent, "paths.abc_missing=error")
    assert_one_line_error(forbidden, "abc_0001", "paths.abc_root")


def process(tmp_path: Path, *overrides: str, **streams) -> subprocess.Popen:
    command = [sys.executable, ROOT / "train.py", *QUICK, f"paths.outputs={tmp_path / 'out'}", *overrides]
    return subprocess.Popen(command, cwd=tmp_path, **streams)


def test_off_a_terminal_it_is_quiet(tmp_path):
    """The whole output of a process: phases, mesh, folder, result; nothing of the libraries, nothing twice."""
    with process(tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as run:
        lines = run.communicate()[0].splitlines()
    assert run.returncode == 0
    begun = [line for line in lines if line.partition(":")[0] in PHASES]
    assert [line.partition(":")[0] for line in begun] == list(PHASES), lines
    assert lines[:2] == begun[:2] == ["start: torch and lightning", "load: part_01"]
    said = [line for line in lines if line not in begun]
    assert len(said) == 11, lines
    assert said[0] == "part_01: 2940 faces, 1 component, watertight"
    assert said[5].startswith("warning: part_01: its thinnest wall (6.72) is under 2 cells of the grid")
    assert said[6] == str(tmp_path / "out" / PLACE)
    assert said[7].startswith("machine: ")
    assert said[8].startswith("part_01 siren: cd_l1 ")
    row = json.loads((tmp_path / "out" / PLACE / "result.json").read_text())["scores"]["unit"]
    within = re.match(
        r"99% of the surface is within (\S+) of the part \(file units; (\S+)% of its longest side\), ", said[9]
    )
    assert within is not None, said[9]
    assert float(within[2]) == pytest.approx(100 * row["surface_p99"], abs=0.01)
    assert float(within[1]) == pytest.approx(row["surface_p99"] * SIDE, rel=0.05)
    assert f"{row['parts_pred']:.0f} of 6 parts" in said[9]
    assert str(tmp_path / "out" / PLACE / "preview.png") in said[10]
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_the_first_line_is_there_before_torch(tmp_path):
    """Importing torch and Lightning takes seconds; what a user typed is answered before."""
    unbuffered = {**os.environ, "PYTHONUNBUFFERED": "1", "PYTHONPROFILEIMPORTTIME": "1"}
    with process(tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=unbuffered) as run:
        lines = run.communicate()[0].splitlines()
    first = next(k for k, line in enumerate(lines) if line == "start: torch and lightning")
    imported = [k for k, line in enumerate(lines) if re.search(r"\| +(torch|lightning|scipy|trimesh)$", line)]
    assert len(imported) >= 4
    assert min(imported) > first, [lines[k] for k in imported if k < first]


def read_all(descriptor: int) -> str:
    chunks = []
    try:
        while chunk := os.read(descriptor, 65536):
            chunks.append(chunk)
    except OSError:  # how Linux says that the other end is closed
        pass
    return b"".join(chunks).decode(errors="replace")


@pytest.mark.slow
def test_on_a_terminal_a_bar_shows_steps_loss_and_speed(tmp_path):
    ours, theirs = pty.openpty()
    terminal = {**os.environ, "TERM": "xterm", "COLUMNS": "120"}
    steps = ["trainer.max_steps=150", "trainer.log_every=50"]
    with process(tmp_path, *steps, stdout=theirs, stderr=theirs, stdin=theirs, env=terminal) as run:
        os.close(theirs)
        text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", read_all(ours))
    os.close(ours)
    assert run.returncode == 0, text
    for name in PHASES:
        assert re.search(rf"(?:^|[\r\n]){name}(?::[^\r\n]*)?[\r\n]", text), name
    found = re.findall(r"(\d+)/150\s+loss (\d+\.\d+)\s+(\d+\.\d) it/s\s+(\d+:\d\d:\d\d|-:--:--)", text)
    assert found, text
    assert any(left != "-:--:--" for *_, left in found), "time left"
    assert "Traceback" not in text
