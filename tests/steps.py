"""Training steps that tests interrupt or count."""

import os

import pytest

from jointsdf.training.module import JointSDFModule


def stop_at(monkeypatch: pytest.MonkeyPatch, step: int, number: int) -> None:
    """Make the process send itself a signal in the middle of this step."""
    original = JointSDFModule.training_step

    def training_step(self, samples, batch_idx):
        if self.global_step == step:
            os.kill(os.getpid(), number)
        return original(self, samples, batch_idx)

    monkeypatch.setattr(JointSDFModule, "training_step", training_step)


def count_steps(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """List to which every step trained from here on is added."""
    steps: list[int] = []
    original = JointSDFModule.training_step

    def training_step(self, samples, batch_idx):
        steps.append(self.global_step)
        return original(self, samples, batch_idx)

    monkeypatch.setattr(JointSDFModule, "training_step", training_step)
    return steps


def forbid_training(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fail at the first training step."""

    def forbidden(*_):
        raise AssertionError("trained again")

    monkeypatch.setattr(JointSDFModule, "training_step", forbidden)
