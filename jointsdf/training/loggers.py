"""Loggers of a run, Lightning's own: TensorBoard, CSV files, Weights & Biases without network."""

import hashlib
from importlib.util import find_spec
from pathlib import Path

from jaxtyping import UInt8
from lightning.pytorch.loggers import CSVLogger, Logger, TensorBoardLogger, WandbLogger
from numpy import ndarray

from jointsdf.errors import InputError, require_one_of
from jointsdf.runs.folder import BOARD

LOGGERS = ("tensorboard", "csv", "wandb")
RUN_PARTS = 5  # of a run folder's path: study, variant, head, shape, seed


def require_logger(name: str) -> None:
    """Refuse a logger that is unknown or not installed.

    Raises:
        InputError: The value and the fix.
    """
    require_one_of("logger", name, LOGGERS)
    if name == "wandb" and find_spec("wandb") is None:
        raise InputError("logger=wandb: the package wandb is not installed: pip install 'jointsdf[wandb]'")


def make_logger(name: str, folder: Path, purge_step: int | None = None) -> Logger:
    """Make a run's logger; what it writes is in the run folder.

    Args:
        name: Of `LOGGERS`.
        folder: The run folder.
        purge_step: Step from which TensorBoard's entries are replaced, those that a resumed run logs again.
    """
    if name == "csv":
        return CSVLogger(folder, name="csv", flush_logs_every_n_steps=1)
    if name == "wandb":
        place = "/".join(folder.parts[-RUN_PARTS:])
        identity = hashlib.sha256(str(folder.resolve()).encode()).hexdigest()[:16]  # the same for a resumed run
        return WandbLogger(place, save_dir=folder, id=identity, project="jointsdf", offline=True)
    return TensorBoardLogger(folder, name="", version=BOARD, default_hp_metric=False, purge_step=purge_step)


def log_picture(logger: Logger, name: str, picture: UInt8[ndarray, "h w 3"], step: int) -> None:
    """Log a picture, where the logger takes any."""
    if isinstance(logger, TensorBoardLogger):
        logger.experiment.add_image(name, picture, step, dataformats="HWC")
    elif isinstance(logger, WandbLogger):
        logger.log_image(name, [picture], step)


def close(logger: Logger) -> None:
    """End what outlives a run otherwise: the next run of a process would write into its run of wandb."""
    logger.finalize("success")
    if isinstance(logger, WandbLogger):
        logger.experiment.finish()
