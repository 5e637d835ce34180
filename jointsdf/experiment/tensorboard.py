"""Log entries of a run besides its losses: previews during the fit, and the finished result."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import UInt8
from lightning import Callback, LightningModule, Trainer
from lightning.pytorch.loggers import Logger, TensorBoardLogger
from numpy import ndarray
from omegaconf import DictConfig
from torch.utils.tensorboard import SummaryWriter

from jointsdf.errors import require_integer
from jointsdf.evaluation.protocol import GroundTruth, Protocol
from jointsdf.extraction.extractor import Extraction
from jointsdf.model.field import JointField
from jointsdf.training.loggers import close, log_picture, make_logger
from jointsdf.training.module import JointSDFModule
from jointsdf.values import LabelledMesh, Subject
from jointsdf.viewing.points import beside_fit, what_is_given
from jointsdf.viewing.tensorboard_mesh import decimate, fits, scene, to_arrays

PREVIEW_POINTS = 5000  # samples on each surface
PREVIEW_WIDTH, PREVIEW_HEIGHT = 480, 360  # pixels
PREVIEW_COLUMNS = ("cd_l1", "nc", "miou")
MESH_RESOLUTIONS = (
    64,
    48,
    32,
    24,
    16,
    8,
)  # tried in turn if the run's mesh cannot be made small enough for the mesh tab


def extract(field: JointField, extraction: Extraction) -> LabelledMesh:
    """Extract the field's labelled mesh, file frame."""
    return extraction.labelled_mesh(
        field.network_sdf, field.network_part, field.normalisation, field.network_differential
    )


@dataclass(frozen=True)
class PreviewSettings:
    """Interval and grid of previews.

    Attributes:
        every: Steps between two previews; 0 for none.
        resolution: Grid points along each axis of the training box.

    Raises:
        InputError: A value out of its range.
    """

    every: int
    resolution: int

    def __post_init__(self) -> None:
        """Check the ranges."""
        require_integer("trainer.preview_every", self.every, 0)
        require_integer("trainer.preview_resolution", self.resolution, 8, 256)


class Preview(Callback):
    """Extracts, scores and draws a coarse mesh every so many steps, in the log under `preview_<resolution>/`.

    Args:
        logger: The run's log.
        score: Mesh -> scores by few points.
        settings: Interval and grid.
        picture: Mesh -> image of it beside what is given.
    """

    def __init__(
        self,
        logger: Logger,
        score: Callable[[LabelledMesh], Mapping[str, float]],
        settings: PreviewSettings,
        picture: Callable[[LabelledMesh], UInt8[ndarray, "h w 3"]],
    ) -> None:
        self.logger, self.score = logger, score
        self.every, self.extraction, self.picture = settings.every, Extraction(settings.resolution), picture

    def on_train_batch_end(self, trainer: Trainer, pl_module: LightningModule, *_: Any) -> None:
        """Add a preview at each interval but the last step, whose result is measured in full."""
        step = trainer.global_step
        if step % self.every or step >= trainer.max_steps:
            return
        assert isinstance(pl_module, JointSDFModule)
        mesh = extract(pl_module.field, self.extraction)
        scores = self.score(mesh)
        tag = f"preview_{self.extraction.resolution}"
        finite = {name: scores[name] for name in PREVIEW_COLUMNS if np.isfinite(scores.get(name, np.nan))}
        self.logger.log_metrics({f"{tag}/{name}": value for name, value in finite.items()}, step)
        log_picture(self.logger, f"{tag}/truth_and_prediction", self.picture(mesh), step)


def preview_settings(cfg: DictConfig) -> PreviewSettings:
    """Interval and grid of the previews."""
    return PreviewSettings(cfg.trainer.preview_every, cfg.trainer.preview_resolution)


def preview_factory(cfg: DictConfig, shape: Subject, protocol: Protocol) -> Callable[[Logger], Preview] | None:
    """Make the function that makes the preview callback of a logger; None without previews.

    Args:
        cfg: The composed config.
        shape: Mesh or point cloud; one without a truth has pictures alone.
        protocol: Protocol whose metrics are used.
    """
    settings = preview_settings(cfg)
    if not settings.every:
        return None
    captions = (what_is_given(shape), f"preview at {settings.resolution}^3, not a result")
    picture = partial(beside_fit(shape), captions=captions, width=PREVIEW_WIDTH, height=PREVIEW_HEIGHT)
    return partial(Preview, score=_scores_by(shape, protocol), settings=settings, picture=picture)


def _scores_by(shape: Subject, protocol: Protocol) -> Callable[[LabelledMesh], Mapping[str, float]]:
    """Score a mesh by few points on the truth; no scores where there is none."""
    if shape.truth is None:
        return lambda _: {}
    truth = GroundTruth(shape.truth.mesh, {"preview": Protocol("preview", PREVIEW_POINTS, "truth", protocol.metrics)})
    return lambda mesh: truth.scores(mesh)["preview"]


@dataclass(frozen=True)
class Finished:
    """A finished run, as logs show it.

    Attributes:
        shape: What it was fitted to.
        field: The fitted field, extracted on a coarser grid if the mesh cannot be made small enough for the mesh tab.
        mesh: The run's mesh, file frame.
        pictures: By name.
        settings: Plain values that name the run: study, variant, recipe, head, shape, seed, and weights of the loss.
        scores: Final scores.
        step: Steps done.
    """

    shape: Subject
    field: JointField
    mesh: LabelledMesh
    pictures: Mapping[str, UInt8[ndarray, "_ _ 3"]]
    settings: Mapping[str, Any]
    scores: Mapping[str, float]
    step: int


def log_result(name: str, folder: Path, run: Finished) -> None:
    """Add the finished run to its log: pictures, meshes, and its settings as hparams with the final scores.

    Args:
        name: Of the logger; `csv` takes nothing, since `result.json` holds it all.
        folder: The run folder.
        run: The run.
    """
    if name == "csv":
        return
    logger = make_logger(name, folder)
    for title, picture in run.pictures.items():
        log_picture(logger, f"result/{title}", picture, run.step)
    finite = {f"result/{score}": value for score, value in run.scores.items() if np.isfinite(value)}
    if isinstance(logger, TensorBoardLogger):
        _log_meshes(logger.experiment, run)
        logger.log_hyperparams(dict(run.settings), finite, run.step)  # SummaryWriter.add_hparams makes a run of its own
    else:
        logger.log_hyperparams(dict(run.settings))
        logger.log_metrics(finite, run.step)
    close(logger)


def _log_meshes(writer: SummaryWriter, run: Finished) -> None:
    """Add ground truth and fit to the mesh tab, which shows of a name only what is before the slash, above both."""
    truth = None if run.shape.truth is None else run.shape.truth.mesh
    fit = None if run.mesh.is_empty else _shown(run)
    both = {"ground truth": None if truth is None else decimate(truth), "fit": fit}
    meshes = {name: mesh for name, mesh in both.items() if mesh is not None}
    study, variant, head, shape, seed = (run.settings[key] for key in ("study", "variant", "head", "shape", "seed"))
    title = f"{shape}, {head}, seed {seed}, {study} {variant}: {' and '.join(meshes)}"
    for place, mesh in enumerate(meshes.values()):
        vertices, colours, faces = map(torch.as_tensor, to_arrays(mesh, truth or mesh, run.shape.up))
        writer.add_mesh(f"{title.replace('/', '_')}/{place}", vertices, colours, faces, scene(), run.step)


def _shown(run: Finished) -> LabelledMesh | None:
    """The run's mesh, decimated or else extracted on coarser grids, as far as the mesh tab needs it."""
    if (small := decimate(run.mesh)) is not None:
        return small
    coarser = (extract(run.field, Extraction(resolution=resolution)) for resolution in MESH_RESOLUTIONS)
    return next((found for found in coarser if not found.is_empty and fits(found)), None)
