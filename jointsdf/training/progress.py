"""Word of how far a fit is: for the screen, and for whoever looks at the run folder."""

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

TELL_SECONDS, REPORT_SECONDS = 0.2, 5.0


class Progress(Callback):
    """Shows steps done of all, loss and steps per second.

    Args:
        max_steps: Length of the run.
    """

    def __init__(self, max_steps: int) -> None:
        self.max_steps = max_steps
        self.told_at, self.told_step = 0.0, 0

    def on_train_start(self, trainer: Trainer, pl_module: LightningModule) -> None:  # noqa: ARG002
        """Begin where a resumed run goes on."""
        self.told_at, self.told_step = time.monotonic(), trainer.global_step
        tell(trainer.global_step, self.max_steps)

    def on_train_batch_end(
        self,
        trainer: Trainer,
        pl_module: LightningModule,  # noqa: ARG002 (Lightning's signature)
        outputs: Tensor | Mapping[str, Any] | None,
        *_: Any,
    ) -> None:
        """Tell a few times a second: fetching the loss makes a GPU wait."""
        step, seconds = trainer.global_step, time.monotonic() - self.told_at
        if seconds < TELL_SECONDS and step < self.max_steps:
            return
        loss = float(outputs["loss"]) if isinstance(outputs, Mapping) else math.nan
        speed = (step - self.told_step) / max(seconds, 1e-9)
        tell(step, facts=f"loss {loss:.3f}  {speed:.1f} it/s")
        self.told_at, self.told_step = time.monotonic(), step


class StatusFile(Callback):
    """Writes to the run folder how far the fit is.

    Args:
        folder: The run folder.
        clock: Seconds of training.
    """

    def __init__(self, folder: Path, clock: TrainingClock) -> None:
        self.folder, self.clock, self.told_at = folder, clock, 0.0

    def on_train_start(self, trainer: Trainer, pl_module: LightningModule) -> None:  # noqa: ARG002
        """Tell where a resumed fit goes on."""
        self._tell(trainer)

    def on_train_batch_end(self, trainer: Trainer, *_: Any) -> None:
        """Tell when it is time."""
        if trainer.global_step >= trainer.max_steps or time.monotonic() - self.told_at >= REPORT_SECONDS:
            self._tell(trainer)

    def _tell(self, trainer: Trainer) -> None:
        note_progress(self.folder, trainer.global_step, trainer.max_steps, self.clock.seconds)
        self.told_at = time.monotonic()
