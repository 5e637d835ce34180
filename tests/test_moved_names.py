"""What was made by earlier versions stays valid: committed rows, run folders, checkpoints, names that people typed."""

import csv
import importlib
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from command_line import ROOT, Answer, call

from jointsdf.experiment.measurement import measure_again
from jointsdf.model.field import JointField
from jointsdf.moved_names import MOVED
from jointsdf.training.module import JointSDFModule

pytestmark = pytest.mark.filterwarnings("default")
STORED = Path(__file__).parent / "stored"  # two run folders of commit b856a11, one stopped in its fit
RUN = (  # what was typed for them
    "recipe=smoke",
    "trainer.max_steps=8",
    "trainer.preview_every=0",
    "trainer.accelerator=cpu",
    *(f"trainer.{key}" for key in ("matmul=default", "backward=float32", "orthogonalisation=float32")),
    "extraction.resolution=16",
    *("data.pool_size=300", "data.cloud_size=1000"),
    *(f"data.counts.{name}=40" for name in ("manifold", "non_manifold", "shell", "pool")),
    *("evaluation.protocols.unit.points=300", "evaluation.protocols.flatcad.points=300"),
    *("trunk.width=16", "head.widths=[8,8]"),
)


def placed(outputs: Path, which: str, variant: str) -> Path:
    """A copy of a stored run folder, where its command looks for it."""
    folder = outputs / f"smoke/{variant}/siren/part_01/seed0"
    shutil.copytree(STORED / which, folder)
    return folder


def again(outputs: Path, *more: str) -> Answer:
    return call("train.py", *RUN, f"paths.outputs={outputs}", *more)


@pytest.fixture
def nothing_is_trained(monkeypatch) -> None:
    def forbidden(*_):
        raise AssertionError("trained again")

    monkeypatch.setattr(JointSDFModule, "training_step", forbidden)


@pytest.mark.skipif("JOINTSDF_ABC" not in os.environ, reason="JOINTSDF_ABC does not name a folder of ABC shapes")
@pytest.mark.usefixtures("nothing_is_trained")
@pytest.mark.parametrize(
    ("study", "shape", "head", "config_hash"),
    [
        ("main", "abc_0003", "siren", "469ccb2c5867b371"),
        ("paired", "abc_0009", "none", "c930c7e8b4d18894"),
        ("points", "abc_0008", "hybrid", "c991053a62d76e80"),
        ("seeds", "abc_0001", "siren", "190dc5eb5285df83"),
    ],
)
def test_a_committed_row_counts_as_done(tmp_path, monkeypatch, study, shape, head, config_hash) -> None:
    """What decides a row's numbers has the hash of before, so that a clone's sweep skips it."""
    monkeypatch.chdir(ROOT)
    given = (f"sweeps={study}", f"shape={shape}", f"head={head}", *(("seed=1",) if study == "seeds" else ()))
    answer = call("train.py", *given, f"paths.outputs={tmp_path}")
    assert answer.lines[-1] == "1 runs: 0 done, 1 skipped, 0 failed, 0 missing", answer.text
    (found,) = tmp_path.rglob("result.json")
    row = json.loads(found.read_text())
    assert row["provenance"]["config_hash"] == config_hash
    source = ROOT / row["provenance"]["reused_from"]
    with source.open(newline="") as file:
        made = {(r["variant"], r["shape"], r["head"], r["seed"]): r["config_hash"] for r in csv.DictReader(file)}
    assert config_hash in made.values()


@pytest.mark.usefixtures("nothing_is_trained")
def test_a_finished_run_is_not_run_again(tmp_path) -> None:
    folder = placed(tmp_path, "finished", "base")
    answer = again(tmp_path)
    assert answer.code == 0, answer.text
    assert answer.lines[0] == f"{folder} holds this run's result already; force=true runs it again"


def test_a_finished_run_measures_as_it_did(tmp_path) -> None:
    row, scores = measure_again(placed(tmp_path, "finished", "base"))
    for protocol, found in scores.items():
        assert found.keys() - row.scores[protocol].keys() == {"parts_ceiling"}  # is measured since
        stored = {name: found[name] for name in row.scores[protocol]}
        assert stored == pytest.approx(row.scores[protocol], rel=1e-3, nan_ok=True)


def test_a_stopped_run_goes_on(tmp_path) -> None:
    folder = placed(tmp_path, "stopped", "half")
    answer = again(tmp_path, "variant=half")
    assert answer.code == 0, answer.text
    assert "going on from step 5 of 8" in answer.lines
    assert (folder / "result.json").is_file()
    whole, halves = (
        JointField.load(path / "field.ckpt") for path in (STORED / "finished", folder)
    )  # the same run in one go
    for name, value in whole.state_dict().items():
        torch.testing.assert_close(value, halves.state_dict()[name], rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize(("old", "new"), MOVED.items())
def test_a_name_of_before_is_the_module_of_now(old, new) -> None:
    if not old.endswith("__main__"):
        assert importlib.import_module(old) is importlib.import_module(new)
        assert importlib.import_module(new).__spec__.name == new


def test_what_is_in_a_moved_package_is_not_loaded_twice() -> None:
    from jointsdf.heads.siren import SirenHead

    from jointsdf.model.heads.siren import SirenHead as of_now

    assert SirenHead is of_now


@pytest.mark.parametrize(
    ("module", "word"), [("jointsdf.figures", "Figures"), ("jointsdf.study", "tables"), ("jointsdf.shapes.abc", "ABC")]
)
def test_a_command_of_before_answers(module, word) -> None:
    done = subprocess.run([sys.executable, "-m", module, "--help"], capture_output=True, text=True, check=True)
    assert word in done.stdout
    assert done.stderr == ""
