"""What happens beside the training: checkpoints that lose little, and word of how far it is."""

import math
import os
import pickle
import signal
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

import torch
from lightning import Callback, LightningModule, Trainer
from torch import Tensor

from jointsdf.errors import InputError
from jointsdf.phases import tell
from jointsdf.training.module import JointSDFModule

TELL_SECONDS = 0.2


class Checkpoints(Callback):
    """Writes `path` every so many seconds and when the run is asked to stop, always between two steps, atomically.

    Args:
        path: The one checkpoint file.
        seconds: Between two writes: what kill -9 can cost.
        step: Step of the checkpoint that is at `path` already, 0 for none.
        products: How the fit multiplies matrices, as `products.noted` puts it, for whoever goes on.
    """

    def __init__(self, path: Path, seconds: float, step: int = 0, products: Mapping[str, Any] | None = None) -> None:
        self.path, self.seconds, self.saved_step, self.products = path, seconds, step, products
        self.asked_to_stop: int | None = None
        self.saved_at = self.started_at = time.monotonic()
        self.seconds_before = 0.0

    @property
    def seconds_trained(self) -> float:
        """Seconds since the start of training, those before an interruption included."""
        return self.seconds_before + time.monotonic() - self.started_at

    @contextmanager
    def stopping_between_steps(self) -> Iterator[None]:
        """Within the block a first Ctrl-C or SIGTERM ends the run after the step in hand; a second one at once.

        Raises:
            SystemExit: One came, with the exit code that a shell gives it.
        """
        previous = self._take_over()
        try:
            yield
            if self.asked_to_stop is not None:  # too late for a step, before the handlers go back
                raise SystemExit
        except SystemExit:
            raise SystemExit(128 + (self.asked_to_stop or signal.SIGTERM)) from None
        finally:
            for number, handler in previous.items():
                signal.signal(number, handler)

    def state_dict(self) -> dict[str, Any]:
        """What the checkpoint keeps of this callback."""
        return {"seconds_trained": self.seconds_trained, "products": self.products}

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """Go on counting."""
        self.seconds_before = state_dict["seconds_trained"]

    def on_train_start(self, trainer: Trainer, pl_module: LightningModule) -> None:  # noqa: ARG002
        """Start the clock, and take SIGTERM back from Lightning, which would end the run between two hooks."""
        self._take_over()
        self.saved_at = self.started_at = time.monotonic()

    def on_train_batch_end(self, trainer: Trainer, *_: Any) -> None:
        """Save when it is time.

        Raises:
            SystemExit: Ctrl-C or SIGTERM came; the checkpoint is written.
        """
        due = time.monotonic() - self.saved_at >= self.seconds
        if due or self.asked_to_stop is not None:
            self.save(trainer)
        if self.asked_to_stop is not None:
            raise SystemExit

    def on_train_end(self, trainer: Trainer, pl_module: LightningModule) -> None:  # noqa: ARG002
        """Save the fitted field, so that an interruption of what follows costs no training."""
        if self.saved_step < trainer.global_step:
            self.save(trainer)

    def save(self, trainer: Trainer) -> None:
        """Write the checkpoint and put it in place in one move; a broken field never replaces a good one."""
        if not all(torch.isfinite(parameter).all() for parameter in trainer.lightning_module.parameters()):
            return
        part = self.path.with_suffix(".part")
        try:
            trainer.save_checkpoint(part)
            os.replace(part, self.path)
        finally:
            part.unlink(missing_ok=True)
        self.saved_at, self.saved_step = time.monotonic(), trainer.global_step

    def _take_over(self) -> dict[signal.Signals, Any]:
        """Handle both signals; returns who did so far."""
        return {number: signal.signal(number, self._stop) for number in (signal.SIGINT, signal.SIGTERM)}

    def _stop(self, number: int, _: FrameType | None) -> None:
        again, self.asked_to_stop = self.asked_to_stop is not None, number
        if again:
            raise SystemExit


class Stored(NamedTuple):
    """What is known of a checkpoint before the fit goes on from it.

    Attributes:
        step: Steps done.
        products: As `products.noted` put them.
    """

    step: int
    products: Mapping[str, Any] | None


def stored(path: Path, module: JointSDFModule) -> Stored:
    """The checkpoint to go on from; step 0 where there is none.

    Raises:
        InputError: It is truncated, not a checkpoint, or of a field of another size.
    """
    if not path.is_file():
        return Stored(0, None)
    try:
        checkpoint = torch.load(path, map_location="cpu", weights_only=True)
        state, step = checkpoint["state_dict"], int(checkpoint["global_step"])
        products = checkpoint.get("callbacks", {}).get("Checkpoints", {}).get("products")
    except (RuntimeError, KeyError, EOFError, TypeError, ValueError, pickle.UnpicklingError) as error:
        raise InputError(f"{path}: damaged checkpoint; resume=never starts the fit over") from error
    sizes = {name: tuple(tensor.shape) for name, tensor in module.state_dict().items()}
    for name in sorted(sizes.keys() | state.keys()):
        found = tuple(state[name].shape) if name in state else None
        if found != sizes.get(name):
            wanted = f"{name} is {found}, not {sizes.get(name)}"
            raise InputError(f"{path}: checkpoint of another field ({wanted}); resume=never starts the fit over")
    return Stored(step, products)


class Progress(Callback):
    """Tells whoever watches steps done of all, loss and steps per second.

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
