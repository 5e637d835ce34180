"""Checkpoints of a fit, written every so many seconds and at a stop, always between two steps."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import torch
from lightning import Callback, LightningModule, Trainer
from lightning.pytorch.plugins.io import TorchCheckpointIO

from jointsdf.errors import InputError
from jointsdf.model.sealed_file import load_sealed, save_sealed
from jointsdf.runs.files import replacing
from jointsdf.training.interruption import StopRequests
from jointsdf.training.module import JointSDFModule
from jointsdf.training.restoring import DAMAGE


@dataclass
class TrainingClock:
    """Seconds of training over all processes of a resumed fit.

    Attributes:
        before: Seconds of earlier processes.
        started: Start of training in this process, monotonic seconds.
    """

    before: float = 0.0
    started: float = field(default_factory=time.monotonic)

    @property
    def seconds(self) -> float:
        """Seconds of training until now."""
        return self.before + time.monotonic() - self.started


class SealedCheckpoints(TorchCheckpointIO):
    """Writes checkpoints with a checksum, and at once in their folder: not in the system's for temporary files."""

    def save_checkpoint(self, checkpoint: dict[str, Any], path: str | Path, storage_options: Any = None) -> None:  # noqa: ARG002
        """Write a checkpoint; Lightning calls this."""
        save_sealed(checkpoint, path)


class Checkpoints(Callback):
    """Writes the one checkpoint file of a fit.

    Args:
        path: The checkpoint file.
        seconds: Seconds between two writes, >= 0: the most that kill -9 can cost.
        stop: Stop requests, checked after every step.
        step: Step of the checkpoint at `path`; 0 for none.
        products: Choice of matrix products for the process that resumes, from `product_choice.choice_record`.

    Attributes:
        saved_step: Step of the last checkpoint written.
        clock: Seconds of training.
    """

    def __init__(
        self,
        path: Path,
        seconds: float,
        stop: StopRequests,
        step: int = 0,
        products: Mapping[str, Any] | None = None,
    ) -> None:
        self.path, self.seconds, self.stop, self.saved_step, self.products = path, seconds, stop, step, products
        self.saved_at, self.clock = time.monotonic(), TrainingClock()

    def state_dict(self) -> dict[str, Any]:
        """State of this callback in the checkpoint."""
        return {"seconds_trained": self.clock.seconds, "products": self.products}

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """Restore the seconds of earlier processes."""
        self.clock.before = state_dict["seconds_trained"]

    def on_train_start(self, trainer: Trainer, pl_module: LightningModule) -> None:  # noqa: ARG002
        """Start the clock, and take SIGTERM back from Lightning, whose handler would end the run between two hooks."""
        self.stop.take_over()
        self.saved_at = self.clock.started = time.monotonic()

    def on_train_batch_end(self, trainer: Trainer, *_: Any) -> None:
        """Save if the interval is over or a stop was requested.

        Raises:
            SystemExit: A stop was requested; the checkpoint is written.
        """
        if self.stop.signal is not None or time.monotonic() - self.saved_at >= self.seconds:
            self.save(trainer)
        self.stop.raise_if_requested()

    def on_train_end(self, trainer: Trainer, pl_module: LightningModule) -> None:  # noqa: ARG002
        """Save the fitted field, so that an interruption of what follows costs no training."""
        if self.saved_step < trainer.global_step:
            self.save(trainer)

    def save(self, trainer: Trainer) -> None:
        """Write the checkpoint; a field with NaN or infinite parameters never replaces a good one."""
        if not all(torch.isfinite(parameter).all() for parameter in trainer.lightning_module.parameters()):
            return
        with replacing(self.path) as temporary:
            trainer.save_checkpoint(temporary)
        self.saved_at, self.saved_step = time.monotonic(), trainer.global_step


class StoredCheckpoint(NamedTuple):
    """Content of a checkpoint that is needed before the fit resumes from it.

    Attributes:
        step: Steps done; 0 without a checkpoint.
        products: Choice of matrix products, from `product_choice.choice_record`.
    """

    step: int
    products: Mapping[str, Any] | None


def read_checkpoint(path: Path, module: JointSDFModule) -> StoredCheckpoint:
    """Read and check the checkpoint to resume from.

    Args:
        path: The checkpoint file, which need not exist.
        module: Module whose parameters' names and shapes the checkpoint must have.

    Raises:
        InputError: It is truncated, not a checkpoint, or of a field of another size.
    """
    if not path.is_file():
        return StoredCheckpoint(0, None)
    try:
        checkpoint = load_sealed(path)
        state, step = checkpoint["state_dict"], int(checkpoint["global_step"])
        products = checkpoint.get("callbacks", {}).get("Checkpoints", {}).get("products")
    except DAMAGE as error:
        raise InputError(f"{path}: damaged checkpoint; resume=never starts the fit over") from error
    sizes = {name: tuple(tensor.shape) for name, tensor in module.state_dict().items()}
    for name in sorted(sizes.keys() | state.keys()):
        found = tuple(state[name].shape) if name in state else None
        if found != sizes.get(name):
            wanted = f"{name} is {found}, not {sizes.get(name)}"
            raise InputError(f"{path}: checkpoint of another field ({wanted}); resume=never starts the fit over")
    return StoredCheckpoint(step, products)
