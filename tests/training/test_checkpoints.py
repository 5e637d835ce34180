"""Checkpoints: a stopped run resumes from them to the same weights, and unusable ones are refused in one line."""

import os
import signal

import pytest
import torch
from command_line import finished, train
from run_folders import assert_same_weights, checkpoint, finished_weights, own_copy, row_of, weights
from steps import count_steps, forbid_training, stop_at

from jointsdf.experiment import run
from jointsdf.training.checkpoints import Checkpoints

pytestmark = pytest.mark.filterwarnings("default")


def test_a_run_stopped_after_its_fit_is_not_trained_again(tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(run, "measure", interrupted)
        stopped = train(tmp_path)
    assert stopped.code == 130
    assert "Traceback" not in stopped.text
    fitted = checkpoint(tmp_path)["state_dict"]
    assert checkpoint(tmp_path)["global_step"] == 4

    forbid_training(monkeypatch)
    again = train(tmp_path)
    assert again.code == 0, again.text
    assert len(list(tmp_path.rglob("result.json"))) == 1
    assert not list(tmp_path.rglob("last.ckpt"))
    assert_same_weights({name.removeprefix("field."): value for name, value in fitted.items()}, weights(tmp_path))


def test_resume_never_starts_over(tmp_path, monkeypatch):
    with monkeypatch.context() as patch:
        stop_at(patch, 1, signal.SIGTERM)
        assert train(tmp_path).code == 143
    steps = count_steps(monkeypatch)
    answer = train(tmp_path, "resume=never")
    assert answer.code == 0
    assert "going on" not in answer.text
    assert steps == [0, 1, 2, 3]
    assert_same_weights(weights(tmp_path), finished_weights())


def test_a_checkpoint_of_torchs_muon_is_refused_by_name(tmp_path, monkeypatch):
    """Which the optimizer was, in version 0.1.0."""
    with monkeypatch.context() as patch:
        stop_at(patch, 1, signal.SIGTERM)
        assert train(tmp_path).code == 143
    (path,) = tmp_path.rglob("last.ckpt")
    stored = checkpoint(tmp_path)
    (state,) = stored["optimizer_states"]
    stored["optimizer_states"] = [{"muon": state["hidden"], "adam": state["rest"]}]
    del stored["sha256"]  # which that version did not write
    torch.save(stored, path)
    answer = train(tmp_path)
    assert answer.code == 2, answer.text
    assert answer.lines[-1].startswith("error: the checkpoint holds the state of torch.optim.Muon")
    assert "Traceback" not in answer.text
    assert train(tmp_path, "resume=never").code == 0
    assert_same_weights(weights(tmp_path), finished_weights())


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
    others = {"optimizer_states": [], "lr_schedulers": [], "loops": {}}
    torch.save({"state_dict": state, "global_step": 2, **others}, folder / "last.ckpt")
    answer = train(tmp_path)
    assert answer.code == 2
    assert "checkpoint of another field (field.part_ids is (9,), not (6,)); resume=never" in answer.lines[-1]
