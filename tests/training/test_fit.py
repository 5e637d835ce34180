"""The fit: weights are a function of the seed, the choice of products is resumed, and divergence stops in one line."""

import json
import math
import signal

import pytest
import torch
from command_line import PLACE, train
from run_folders import assert_same_weights, checkpoint, weights
from steps import stop_at

from jointsdf.losses.dirichlet import Dirichlet

pytestmark = pytest.mark.filterwarnings("default")
TEN = ("trainer.max_steps=10", "trainer.log_every=5")


def test_any_number_of_workers_gives_the_same_weights(tmp_path):
    for workers in (0, 2):
        assert train(tmp_path / str(workers), *TEN, f"data.workers={workers}").code == 0
    assert_same_weights(weights(tmp_path / "0"), weights(tmp_path / "2"))


def test_another_seed_gives_other_weights(tmp_path):
    for seed in (0, 1):
        assert train(tmp_path / str(seed), f"seed={seed}").code == 0
    first, second = weights(tmp_path / "0"), weights(tmp_path / "1")
    assert not torch.equal(first["trunk.output.weight"], second["trunk.output.weight"])


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
