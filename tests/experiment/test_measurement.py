"""A finished run measured again: the same numbers, and one line where it cannot be measured."""

import json
import shutil

import numpy as np
import pytest
import trimesh
from command_line import call, finished, train
from run_folders import own_copy, row_of

from jointsdf.experiment import measurement

pytestmark = pytest.mark.filterwarnings("default")


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


def test_measured_again_it_multiplies_matrices_as_the_run_did(monkeypatch):
    asked: list[str] = []
    monkeypatch.setattr(measurement, "use_matmul", asked.append)
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
