"""Errors of going on from a checkpoint, up to the first step, as one line about its file."""

import pickle
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch
from lightning import Callback, LightningModule, Trainer

from jointsdf.errors import InputError, first_line, shown

DAMAGE = (  # what reading and restoring raise for truncated, flipped and foreign content
    *(LookupError, TypeError, ValueError, AttributeError, AssertionError, ArithmeticError, RuntimeError),
    *(OSError, EOFError, pickle.UnpicklingError),
)
ONE_EACH = ("optimizer_states", "lr_schedulers")  # of which Lightning restores as many as there are


class Restoring(Callback):
    """Tells errors of a damaged checkpoint from those of the training.

    Args:
        path: The checkpoint; it need not exist.

    Attributes:
        step: Step that the checkpoint claims; 0 for none.
        is_seen: Whether the checkpoint's content was checked.
        is_over: Whether a step was made, so that whatever follows is no matter of the checkpoint.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.step, self.is_seen, self.is_over = path, 0, False, False

    def on_load_checkpoint(
        self,
        trainer: Trainer,  # noqa: ARG002
        pl_module: LightningModule,  # noqa: ARG002
        checkpoint: Mapping[str, Any],
    ) -> None:
        """Check what Lightning would leave out without a word.

        Raises:
            ValueError: There are more states than one, or less.
        """
        for name in ONE_EACH:
            if not isinstance(checkpoint[name], list) or len(checkpoint[name]) != 1:
                raise ValueError(f"{name} holds no single state")
        self.is_seen = True

    def on_train_start(self, trainer: Trainer, pl_module: LightningModule) -> None:  # noqa: ARG002
        """Compare the step that Lightning restored.

        Raises:
            ValueError: It is not the checkpoint's, or the checkpoint has no state of callbacks.
        """
        if trainer.global_step != self.step or self.is_seen != (self.step > 0):
            raise ValueError(f"step {self.step}, and loops at step {trainer.global_step}")

    def on_train_batch_end(self, *_: object) -> None:
        """A step was made: optimizer and rates fit the parameters."""
        self.is_over = True

    @contextmanager
    def errors(self) -> Iterator[None]:
        """Turn errors within the block, up to the first step, into one line about the checkpoint.

        Errors without a checkpoint, those of memory, and those that name a file of their own are raised as they are.

        Raises:
            InputError: The checkpoint is damaged.
        """
        try:
            yield
        except DAMAGE as error:
            own = isinstance(error, InputError | torch.OutOfMemoryError) or getattr(error, "filename", None)
            if own or self.is_over or not self.path.is_file():
                raise
            said = shown(f"{type(error).__name__}: {first_line(error)}", 200)
            raise InputError(f"{self.path}: damaged checkpoint ({said}); resume=never starts the fit over") from error
