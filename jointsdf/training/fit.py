"""The fit: Lightning's loop around the module, resumed from its checkpoint."""

import logging
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import torch
from lightning import Callback, LightningDataModule, Trainer
from lightning.fabric.utilities.exceptions import MisconfigurationException
from lightning.pytorch.callbacks import LearningRateMonitor
from lightning.pytorch.loggers import Logger

from jointsdf.errors import InputError, require_number, require_one_of
from jointsdf.model.field import JointField
from jointsdf.runs.files import replacing
from jointsdf.runs.folder import CHECKPOINT
from jointsdf.threads import workers
from jointsdf.training.checkpoints import Checkpoints, SealedCheckpoints, read_checkpoint
from jointsdf.training.interruption import StopRequests
from jointsdf.training.last_layer import refit_last_layer
from jointsdf.training.loggers import close, make_logger, require_logger
from jointsdf.training.matrix_products import Products
from jointsdf.training.module import JointSDFModule
from jointsdf.training.product_choice import choice_record, machine_kind, set_products
from jointsdf.training.progress import Progress, StatusFile
from jointsdf.training.restoring import Restoring
from jointsdf.training.settings import FitSettings
from jointsdf.values import LabelledPoints

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class FitMachine:
    """Device, matrix products, checkpoint interval and logger of a fit; none of it is part of a run's identity.

    Attributes:
        products: Library and precisions of matrix products; `auto` values are chosen on this machine.
        accelerator: `auto`, `cpu` or `gpu`; one device.
        checkpoint_seconds: Seconds between two checkpoints: the most that kill -9 can cost.
        logger: `tensorboard`, `csv` or `wandb`.

    Raises:
        InputError: A value out of its range.
    """

    products: Products = Products()  # noqa: RUF009 (frozen)
    accelerator: str = "auto"
    checkpoint_seconds: float = 20.0
    logger: str = "tensorboard"

    def __post_init__(self) -> None:
        """Check the ranges."""
        require_one_of("trainer.accelerator", self.accelerator, ("auto", "cpu", "gpu"))
        require_number("trainer.checkpoint_seconds", self.checkpoint_seconds, 0)
        require_logger(self.logger)


def fit(
    module: JointSDFModule,
    data: LightningDataModule,
    folder: Path,
    machine: FitMachine,
    *,
    labelled: LabelledPoints | None = None,
    preview: Callable[[Logger], Callback] | None = None,
) -> tuple[float, dict[str, str | int]]:
    """Train to the module's `max_steps`, resuming from the folder's checkpoint if there is one; refit the last layer.

    Args:
        module: Module to train; on the CPU and in evaluation mode afterwards.
        data: Samples of each step.
        folder: The run folder.
        machine: Device, matrix products, checkpoint interval and logger.
        labelled: Points to which the head's last layer is refitted after the steps; None for no refit.
        preview: Makes the callback that previews the run.

    Returns:
        Seconds of training, those before an interruption included; and for the row's provenance: matrix products,
        threads, device and kind of machine.

    Raises:
        InputError: The checkpoint cannot be read, or a loss is not finite.
        SystemExit: Ctrl-C or SIGTERM; the checkpoint is written.
    """
    path, steps, threads = folder / CHECKPOINT, module.settings.max_steps, workers()
    restoring = Restoring(path)
    with restoring.errors():
        done, before = read_checkpoint(path, module)
        if not 0 <= done <= steps:
            raise ValueError(f"step {done} of {steps}")
    restoring.step = done
    gpu = machine.accelerator != "cpu" and torch.cuda.is_available()
    sizes = replace(module.sizes, device=torch.device("cuda" if gpu else "cpu"))
    module.products = set_products(machine.products, sizes, before)
    if done:
        log.info("going on from step %d of %d", done, steps)
    logger = make_logger(machine.logger, folder, purge_step=done or None)  # steps after the checkpoint are logged again
    stop = StopRequests()
    checkpoints = Checkpoints(path, machine.checkpoint_seconds, stop, done, choice_record(module.products, sizes))
    callbacks: list[Callback] = [checkpoints, LearningRateMonitor("step"), StatusFile(folder, checkpoints.clock)]
    callbacks += [Progress(steps), restoring]
    callbacks += [preview(logger)] if preview else []
    trainer = _trainer(machine.accelerator, module.settings, logger, callbacks)
    try:
        with stop.handled(), restoring.errors():
            trainer.fit(module, datamodule=data, ckpt_path=path if done else None, weights_only=True)
    except SystemExit:
        log.warning("stopped after step %d of %d; the same command goes on from there", checkpoints.saved_step, steps)
        raise
    finally:
        close(logger)
    device = torch.cuda.get_device_name(module.device) if module.device.type == "cuda" else module.device.type
    module.to("cpu").eval()
    if labelled is not None:
        refit_last_layer(module.field, labelled, module.settings.refit)
    return checkpoints.clock.seconds, asdict(module.products) | {
        "threads": threads,
        "device": device,
        "kind": machine_kind(),
    }


def save_field(field: JointField, path: Path) -> None:
    """Write the field atomically.

    Raises:
        OSError: The folder cannot be written or the disk is full.
    """
    with replacing(path) as temporary:
        field.save(temporary)


def _trainer(accelerator: str, settings: FitSettings, logger: Logger, callbacks: list[Callback]) -> Trainer:
    """Make Lightning's loop, without its own output, checkpoints and sanity checks."""
    try:
        return Trainer(
            accelerator=accelerator,
            devices=1,
            max_steps=settings.max_steps,
            max_epochs=-1,
            logger=logger,
            callbacks=callbacks,
            plugins=[SealedCheckpoints()],
            log_every_n_steps=settings.log_every,
            enable_checkpointing=False,
            enable_progress_bar=False,
            enable_model_summary=False,
            inference_mode=False,
        )
    except MisconfigurationException as error:
        raise InputError(f"trainer.accelerator={accelerator}: {error}; use cpu or auto") from error
