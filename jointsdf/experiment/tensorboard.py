"""TensorBoard entries of a run: previews during the fit, and the finished result."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import chain
from typing import Any

import numpy as np
import torch
from jaxtyping import UInt8
from lightning import Callback, LightningModule, Trainer
from lightning.pytorch.loggers import TensorBoardLogger
from numpy import ndarray
from omegaconf import DictConfig
from torch.utils.tensorboard import SummaryWriter

from jointsdf.errors import require_integer
from jointsdf.evaluation.protocol import GroundTruth, Protocol
from jointsdf.extraction.extractor import Extraction
from jointsdf.model.field import JointField
from jointsdf.training.module import JointSDFModule
from jointsdf.values import LabelledMesh, Subject
from jointsdf.viewing.export import fits_tensorboard, tensorboard_mesh
from jointsdf.viewing.points import beside_fit, what_is_given

PREVIEW_POINTS = 5000  # samples on each surface
PREVIEW_WIDTH, PREVIEW_HEIGHT = 320, 240  # pixels
PREVIEW_COLUMNS = ("cd_l1", "nc", "miou")
MESH_RESOLUTIONS = (64, 48, 32, 24, 16, 8)  # tried in turn if the run's mesh is too large for the mesh tab


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
    """Extracts, scores and draws a coarse mesh every so many steps, in TensorBoard under `preview_<resolution>/`.

    Args:
        writer: Writer of the run's log.
        score: Mesh -> scores by few points.
        settings: Interval and grid.
        picture: Mesh -> image of it beside what is given.
    """

    def __init__(
        self,
        writer: SummaryWriter,
        score: Callable[[LabelledMesh], Mapping[str, float]],
        settings: PreviewSettings,
        picture: Callable[[LabelledMesh], UInt8[ndarray, "h w 3"]],
    ) -> None:
        self.writer, self.score = writer, score
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
        for column in PREVIEW_COLUMNS:
            if np.isfinite(scores.get(column, np.nan)):
                self.writer.add_scalar(f"{tag}/{column}", scores[column], step)
        self.writer.add_image(f"{tag}/truth_and_prediction", self.picture(mesh), step, dataformats="HWC")


def preview_settings(cfg: DictConfig) -> PreviewSettings:
    """Interval and grid of the previews."""
    return PreviewSettings(cfg.trainer.preview_every, cfg.trainer.preview_resolution)


def preview_factory(cfg: DictConfig, shape: Subject, protocol: Protocol) -> Callable[[SummaryWriter], Preview] | None:
    """Make the function that makes the preview callback of a writer; None without previews.

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


def log_result(
    logger: TensorBoardLogger,
    field: JointField,
    mesh: LabelledMesh,
    pictures: Mapping[str, UInt8[ndarray, "_ _ 3"]],
    settings: Mapping[str, Any],
    scores: Mapping[str, float],
    step: int,
) -> None:
    """Add the finished run to TensorBoard: pictures, mesh, and its settings as hparams with the final scores.

    Args:
        logger: The run's log.
        field: The fitted field, extracted on a coarser grid if the mesh is too large for the mesh tab.
        mesh: The run's mesh, file frame.
        pictures: By name.
        settings: Plain values that name the run.
        scores: Final scores.
        step: Steps done.
    """
    for name, picture in pictures.items():
        logger.experiment.add_image(f"result/{name}", picture, step, dataformats="HWC")
    _log_mesh(logger.experiment, field, mesh, step)
    finite = {f"result/{name}": value for name, value in scores.items() if np.isfinite(value)}
    logger.log_hyperparams(dict(settings), finite, step)  # SummaryWriter.add_hparams would make a run of its own
    logger.finalize("success")


def _log_mesh(writer: SummaryWriter, field: JointField, mesh: LabelledMesh, step: int) -> None:
    """Add the mesh to the mesh tab; nothing for a field without a surface."""
    if mesh.is_empty:
        return
    coarser = (extract(field, Extraction(resolution=resolution)) for resolution in MESH_RESOLUTIONS)
    fitting = (found for found in chain([mesh], coarser) if not found.is_empty and fits_tensorboard(found))
    if (shown := next(fitting, None)) is None:
        return
    vertices, colours, faces = (torch.as_tensor(array) for array in tensorboard_mesh(shown))
    camera = {"cls": "PerspectiveCamera", "fov": 60, "position": [0, 0, 3.3]}
    lights = [
        {"cls": "AmbientLight", "color": "#ffffff", "intensity": 0.9},
        {"cls": "DirectionalLight", "color": "#ffffff", "intensity": 0.7, "position": [1, 2, 3]},
    ]
    writer.add_mesh("result/mesh", vertices, colours, faces, {"camera": camera, "lights": lights}, global_step=step)
