"""The fit: Lightning's loop around the module, with checkpoints to go on from."""

import errno
import logging
import os
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import torch
from lightning import Callback, LightningDataModule, LightningModule, Trainer
from lightning.fabric.utilities.exceptions import MisconfigurationException
from lightning.pytorch.callbacks import LearningRateMonitor
from lightning.pytorch.loggers import TensorBoardLogger
from torch.utils.tensorboard import SummaryWriter

from jointsdf.errors import InputError
from jointsdf.model.field import JointField
from jointsdf.runs.folder import BOARD, CHECKPOINT
from jointsdf.runs.status import report
from jointsdf.threads import workers
from jointsdf.training.checkpoints import Checkpoints, Progress, stored
from jointsdf.training.matrix_products import Products, machine_kind, noted, used
from jointsdf.training.module import JointSDFModule

log = logging.getLogger(__name__)

REPORT_SECONDS = 5.0


def fit(
    module: JointSDFModule,
    data: LightningDataModule,
    folder: Path,
    *,
    products: Products,
    accelerator: str,
    checkpoint_seconds: float,
    log_every: int,
    preview: Callable[[SummaryWriter], Callback] | None,
) -> tuple[float, dict[str, str | int]]:
    """Train to the module's `max_steps`, going on from the folder's checkpoint where there is one.

    Args:
        module: What is trained; on the CPU and in evaluation mode afterwards.
        data: Its samples.
        folder: The run folder.
        products: How matrices shall be multiplied; `auto` where that is to be measured.
        accelerator: `auto`, `cpu` or `gpu`.
        checkpoint_seconds: What kill -9 can cost.
        log_every: Steps between two TensorBoard points.
        preview: Makes the callback that looks at the run under way.

    Returns:
        Seconds of training, those before an interruption included, and what the fit used of this machine.

    Raises:
        InputError: The checkpoint cannot be read, or a loss is not finite.
        SystemExit: Ctrl-C or SIGTERM; the checkpoint is written.
    """
    path, steps, threads = folder / CHECKPOINT, module.max_steps, workers()
    done, before = stored(path, module)
    gpu = accelerator != "cpu" and torch.cuda.is_available()
    sizes = replace(module.sizes, device=torch.device("cuda" if gpu else "cpu"))
    module.products = used(products, sizes, before)
    if done:
        log.info("going on from step %d of %d", done, steps)
    board = board_of(folder, purge_step=done or None)  # what was logged after the checkpoint comes again
    checkpoints = Checkpoints(path, checkpoint_seconds, done, noted(module.products, sizes))
    callbacks: list[Callback] = [checkpoints, LearningRateMonitor("step"), StatusFile(folder, checkpoints)]
    callbacks += [Progress(steps)]
    callbacks += [preview(board.experiment)] if preview else []
    trainer = _trainer(accelerator, steps, board, callbacks, log_every)
    try:
        with checkpoints.stopping_between_steps():
            trainer.fit(module, datamodule=data, ckpt_path=path if done else None, weights_only=True)
    except SystemExit:
        log.warning("stopped after step %d of %d; the same command goes on from there", checkpoints.saved_step, steps)
        raise
    device = torch.cuda.get_device_name(module.device) if module.device.type == "cuda" else module.device.type
    module.to("cpu").eval()
    return checkpoints.seconds_trained, asdict(module.products) | {
        "threads": threads,
        "device": device,
        "kind": machine_kind(),
    }


class StatusFile(Callback):
    """Tells whoever looks at the run folder how far the fit is.

    Args:
        folder: The run folder.
        checkpoints: Knows the seconds of training.
    """

    def __init__(self, folder: Path, checkpoints: Checkpoints) -> None:
        self.folder, self.checkpoints, self.told_at = folder, checkpoints, 0.0

    def on_train_start(self, trainer: Trainer, pl_module: LightningModule) -> None:  # noqa: ARG002
        """Tell where a resumed fit goes on."""
        self._tell(trainer)

    def on_train_batch_end(self, trainer: Trainer, *_: Any) -> None:
        """Tell when it is time."""
        if trainer.global_step >= trainer.max_steps or time.monotonic() - self.told_at >= REPORT_SECONDS:
            self._tell(trainer)

    def _tell(self, trainer: Trainer) -> None:
        report(self.folder, trainer.global_step, trainer.max_steps, self.checkpoints.seconds_trained)
        self.told_at = time.monotonic()


def board_of(folder: Path, purge_step: int | None = None) -> TensorBoardLogger:
    """The run's TensorBoard log; entries from `purge_step` on are replaced."""
    return TensorBoardLogger(folder, name="", version=BOARD, default_hp_metric=False, purge_step=purge_step)


def save_field(field: JointField, path: Path) -> None:
    """Write the field so that it is never half-written.

    Raises:
        OSError: The folder cannot be written or the disk is full.
    """
    part = path.with_suffix(".part")
    try:
        field.save(part)
        os.replace(part, path)
    except RuntimeError as error:  # torch's answer to a failed write
        raise OSError(errno.ENOSPC, "cannot be written", str(path)) from error
    finally:
        part.unlink(missing_ok=True)


def _trainer(
    accelerator: str, steps: int, board: TensorBoardLogger, callbacks: list[Callback], log_every: int
) -> Trainer:
    """Lightning's loop without its own output, checkpoints and sanity checks."""
    try:
        return Trainer(
            accelerator=accelerator,
            devices=1,
            max_steps=steps,
            max_epochs=-1,
            logger=board,
            callbacks=callbacks,
            log_every_n_steps=log_every,
            enable_checkpointing=False,
            enable_progress_bar=False,
            enable_model_summary=False,
            inference_mode=False,
        )
    except MisconfigurationException as error:
        raise InputError(f"trainer.accelerator={accelerator}: {error}; use cpu or auto") from error
