"""A run that is stopped, in any way and at any moment, goes on to the same weights by the same command."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest
import torch
from command_line import PLACE, QUICK, ROOT, finished, train

from jointsdf.experiment import run as experiment
from jointsdf.training.checkpoints import Checkpoints
from jointsdf.training.module import JointSDFModule

pytestmark = pytest.mark.filterwarnings("default")
TEN = ("trainer.max_steps=10", "trainer.log_every=5")


def weights(outputs):
    (path,) = outputs.rglob("field.ckpt")
    return torch.load(path, weights_only=True)["state"]


def checkpoint(outputs):
    (path,) = outputs.rglob("last.ckpt")
    return torch.load(path, weights_only=True)


def assert_same_weights(one, other):
    assert one.keys() == other.keys()
    for name in one:
        assert torch.equal(one[name], other[name]), name


def stop_at(monkeypatch, step, number):
    """Make the process send itself a signal in the middle of this step."""
    original = JointSDFModule.training_step

    def training_step(self, samples, batch_idx):
        if self.global_step == step:
            os.kill(os.getpid(), number)
        return original(self, samples, batch_idx)

    monkeypatch.setattr(JointSDFModule, "training_step", training_step)


def counted(monkeypatch):
    """The steps that are trained from here on."""
    steps, original = [], JointSDFModule.training_step

    def training_step(self, samples, batch_idx):
        steps.append(self.global_step)
        return original(self, samples, batch_idx)

    monkeypatch.setattr(JointSDFModule, "training_step", training_step)
    return steps


@pytest.mark.parametrize(
    ("number", "overrides"),
    [
        (signal.SIGINT, ["head=relu"]),
        (signal.SIGTERM, ["head=hybrid", "trainer.preview_every=3"]),
        (signal.SIGTERM, ["head=deep_skip", "data.workers=2"]),
        (signal.SIGINT, ["head=none", "optimizer=adam", "data.counts.balanced=0"]),
    ],
)
def test_ten_steps_are_five_and_five_more(tmp_path, monkeypatch, number, overrides):
    whole, halves = tmp_path / "whole", tmp_path / "halves"
    first = train(whole, *TEN, *overrides)
    assert first.code == 0, first.text
    with monkeypatch.context() as patch:
        stop_at(patch, 4, number)
        stopped = train(halves, *TEN, *overrides)
    assert stopped.code == 128 + number
    assert "stopped after step 5 of 10; the same command goes on from there" in stopped.lines
    assert "Traceback" not in stopped.text
    assert checkpoint(halves)["global_step"] == 5
    assert not list(halves.rglob("result.json"))

    steps = counted(monkeypatch)
    resumed = train(halves, *TEN, *overrides)
    assert resumed.code == 0, resumed.text
    assert "going on from step 5 of 10" in resumed.lines
    assert steps == [5, 6, 7, 8, 9]
    assert_same_weights(weights(whole), weights(halves))


def test_any_number_of_workers_gives_the_same_weights(tmp_path):
    for workers in (0, 2):
        assert train(tmp_path / str(workers), *TEN, f"data.workers={workers}").code == 0
    assert_same_weights(weights(tmp_path / "0"), weights(tmp_path / "2"))


def test_another_seed_gives_other_weights(tmp_path):
    for seed in (0, 1):
        assert train(tmp_path / str(seed), f"seed={seed}").code == 0
    first, second = weights(tmp_path / "0"), weights(tmp_path / "1")
    assert not torch.equal(first["trunk.output.weight"], second["trunk.output.weight"])


def test_a_run_stopped_after_its_fit_is_not_trained_again(tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(experiment, "measure", interrupted)
        stopped = train(tmp_path)
    assert stopped.code == 130
    assert "Traceback" not in stopped.text
    fitted = checkpoint(tmp_path)["state_dict"]
    assert checkpoint(tmp_path)["global_step"] == 4

    def forbidden(*_):
        raise AssertionError("trained again")

    monkeypatch.setattr(JointSDFModule, "training_step", forbidden)
    again = train(tmp_path)
    assert again.code == 0, again.text
    assert len(list(tmp_path.rglob("result.json"))) == 1
    assert not list(tmp_path.rglob("last.ckpt"))
    assert_same_weights({name.removeprefix("field."): value for name, value in fitted.items()}, weights(tmp_path))


def test_resume_never_starts_over(tmp_path, monkeypatch):
    with monkeypatch.context() as patch:
        stop_at(patch, 1, signal.SIGTERM)
        assert train(tmp_path).code == 143
    steps = counted(monkeypatch)
    answer = train(tmp_path, "resume=never")
    assert answer.code == 0
    assert "going on" not in answer.text
    assert steps == [0, 1, 2, 3]
    assert_same_weights(weights(tmp_path), weights(finished().parents[len(PLACE.parts) - 1]))


def test_a_checkpoint_of_torchs_muon_is_refused_by_name(tmp_path, monkeypatch):
    """Which the optimizer was, in version 0.1.0."""
    with monkeypatch.context() as patch:
        stop_at(patch, 1, signal.SIGTERM)
        assert train(tmp_path).code == 143
    (path,) = tmp_path.rglob("last.ckpt")
    stored = checkpoint(tmp_path)
    (state,) = stored["optimizer_states"]
    stored["optimizer_states"] = [{"muon": state["hidden"], "adam": state["rest"]}]
    torch.save(stored, path)
    answer = train(tmp_path)
    assert answer.code == 2, answer.text
    assert answer.lines[-1].startswith("error: the checkpoint holds the state of torch.optim.Muon")
    assert "Traceback" not in answer.text
    assert train(tmp_path, "resume=never").code == 0
    assert_same_weights(weights(tmp_path), weights(finished().parents[len(PLACE.parts) - 1]))


def test_a_checkpoints_choice_of_products_goes_on(tmp_path, monkeypatch):
    """Whatever is measured or kept meanwhile."""
    with monkeypatch.context() as patch:
        stop_at(patch, 1, signal.SIGTERM)
        assert train(tmp_path, "trainer.orthogonalisation=bfloat16").code == 143
    assert checkpoint(tmp_path)["callbacks"]["Checkpoints"]["products"]["products"]["orthogonalisation"] == "bfloat16"
    answer = train(tmp_path)
    assert answer.code == 0
    assert "orthogonalisation in bfloat16 (of the checkpoint)" in answer.text
    (row,) = tmp_path.rglob("result.json")
    assert json.loads(row.read_text())["provenance"]["orthogonalisation"] == "bfloat16"


@pytest.mark.parametrize("hook", ["on_train_start", "on_train_end"])
def test_a_signal_before_the_first_and_after_the_last_step_is_not_lost(tmp_path, monkeypatch, hook):
    original = getattr(Checkpoints, hook)

    def signalled(*arguments):
        os.kill(os.getpid(), signal.SIGTERM)
        original(*arguments)

    with monkeypatch.context() as patch:
        patch.setattr(Checkpoints, hook, signalled)
        assert train(tmp_path).code == 143
    assert not list(tmp_path.rglob("result.json"))
    assert train(tmp_path).code == 0
    assert_same_weights(weights(tmp_path), weights(finished().parents[len(PLACE.parts) - 1]))


def test_the_second_signal_ends_the_run_at_once(tmp_path, monkeypatch):
    original = JointSDFModule.training_step

    def training_step(self, samples, batch_idx):
        if self.global_step == 2:
            os.kill(os.getpid(), signal.SIGINT)
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.01)
            raise AssertionError("went on")
        return original(self, samples, batch_idx)

    monkeypatch.setattr(JointSDFModule, "training_step", training_step)
    answer = train(tmp_path, "trainer.checkpoint_seconds=0")
    assert answer.code == 130
    assert "stopped after step 2 of 4; the same command goes on from there" in answer.lines
    assert checkpoint(tmp_path)["global_step"] == 2


def test_the_handlers_of_the_process_come_back(tmp_path):
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    assert train(tmp_path).code == 0
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before


def test_a_checkpoint_is_never_half_written(tmp_path, monkeypatch):
    """A write that breaks off leaves the checkpoint before it."""
    original, saved = Checkpoints.save, []

    def save(self, trainer):
        if saved:
            monkeypatch.setattr(os, "replace", lambda *_: (_ for _ in ()).throw(OSError(28, "No space left on device")))
        saved.append(trainer.global_step)
        original(self, trainer)

    monkeypatch.setattr(Checkpoints, "save", save)
    answer = train(tmp_path, "trainer.checkpoint_seconds=0")
    assert answer.code == 2
    assert saved == [1, 2]
    assert checkpoint(tmp_path)["global_step"] == 1
    assert not list(tmp_path.rglob("*.part"))


def wait_for(path, process, seconds=120):
    for _ in range(seconds * 100):
        if path.exists() or process.poll() is not None:
            return
        time.sleep(0.01)


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
def test_a_killed_process_goes_on(tmp_path, number):
    """The real thing: a process of its own, killed at a moment of no one's choice."""
    long = ["trainer.max_steps=60", "trainer.checkpoint_seconds=0"]
    assert train(tmp_path / "whole", *long).code == 0
    killed = tmp_path / "killed"
    command = [sys.executable, ROOT / "train.py", *QUICK, f"paths.outputs={killed}", *long]
    threads = {**os.environ, "OMP_NUM_THREADS": str(torch.get_num_threads())}  # sums depend on their number
    with subprocess.Popen(command, env=threads, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        wait_for(killed / PLACE / "last.ckpt", process)
        process.send_signal(number)
        output = process.communicate()[0]
    assert process.returncode == (-9 if number == signal.SIGKILL else 128 + number)
    assert "Traceback" not in output
    assert 1 <= checkpoint(killed)["global_step"] < 60
    answer = train(killed, *long)
    assert answer.code == 0
    assert "going on from step" in answer.text
    assert_same_weights(weights(tmp_path / "whole"), weights(killed))
