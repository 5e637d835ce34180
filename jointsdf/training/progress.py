"""Progress of a fit, on screen and in the run folder."""

import math
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lightning import Callback, LightningModule, Trainer
from torch import Tensor

from jointsdf.phases import tell
from jointsdf.runs.status import note_progress
from jointsdf.training.checkpoints import TrainingClock

SCREEN_SECONDS, FILE_SECONDS = 0.2, 5.0  # between two updates


class Progress(Callback):
    """Shows steps done, loss and steps per second.

    Args:
        max_steps: Length of the run.
    """

    def __init__(self, max_steps: int) -> None:
        self.max_steps = max_steps
        self.updated_at, self.updated_step = 0.0, 0

    def on_train_start(self, trainer: Trainer, pl_module: LightningModule) -> None:  # noqa: ARG002
        """Show the step from which the fit starts or resumes."""
        self.updated_at, self.updated_step = time.monotonic(), trainer.global_step
        tell(trainer.global_step, self.max_steps)

    def on_train_batch_end(
        self,
        trainer: Trainer,
        pl_module: LightningModule,  # noqa: ARG002 (Lightning's signature)
        outputs: Tensor | Mapping[str, Any] | None,
        *_: Any,
    ) -> None:
        """Update a few times a second: fetching the loss makes a GPU wait."""
        step, seconds = trainer.global_step, time.monotonic() - self.updated_at
        if seconds < SCREEN_SECONDS and step < self.max_steps:
            return
        loss = float(outputs["loss"]) if isinstance(outputs, Mapping) else math.nan
        speed = (step - self.updated_step) / max(seconds, 1e-9)
        tell(step, facts=f"loss {loss:.3f}  {speed:.1f} it/s")
        self.updated_at, self.updated_step = time.monotonic(), step


class StatusFile(Callback):
    """Writes the progress of the fit to the run folder.

    Args:
        folder: The run folder.
        clock: Seconds of training.
    """

    def __init__(self, folder: Path, clock: TrainingClock) -> None:
        self.folder, self.clock, self.updated_at = folder, clock, 0.0

    def on_train_start(self, trainer: Trainer, pl_module: LightningModule) -> None:  # noqa: ARG002
        """Write the step from which the fit starts or resumes."""
        self._write(trainer)

    def on_train_batch_end(self, trainer: Trainer, *_: Any) -> None:
        """Write every few seconds, and after the last step."""
        if trainer.global_step >= trainer.max_steps or time.monotonic() - self.updated_at >= FILE_SECONDS:
            self._write(trainer)

    def _write(self, trainer: Trainer) -> None:
        note_progress(self.folder, trainer.global_step, trainer.max_steps, self.clock.seconds)
        self.updated_at = time.monotonic()
