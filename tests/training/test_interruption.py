"""Ctrl-C, SIGTERM and kill -9 at any moment of a fit: the same command resumes to the same weights."""

import os
import signal
import subprocess
import sys
import time

import pytest
import torch
from command_line import PLACE, QUICK, ROOT, train
from run_folders import assert_same_weights, checkpoint, finished_weights, weights
from steps import count_steps, stop_at

from jointsdf.training.checkpoints import Checkpoints
from jointsdf.training.module import JointSDFModule

pytestmark = pytest.mark.filterwarnings("default")
TEN = ("trainer.max_steps=10", "trainer.log_every=5")


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

    steps = count_steps(monkeypatch)
    resumed = train(halves, *TEN, *overrides)
    assert resumed.code == 0, resumed.text
    assert "going on from step 5 of 10" in resumed.lines
    assert steps == [5, 6, 7, 8, 9]
    assert_same_weights(weights(whole), weights(halves))


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
    assert_same_weights(weights(tmp_path), finished_weights())


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
