"""What TensorBoard shows of a run: previews on the way, and the finished result."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
import torch
from jaxtyping import UInt8
from lightning import Callback, LightningModule, Trainer
from lightning.pytorch.loggers import TensorBoardLogger
from numpy import ndarray
from torch.utils.tensorboard import SummaryWriter

from jointsdf.errors import require_integer
from jointsdf.evaluation.protocol import GroundTruth, Protocol
from jointsdf.extraction.extractor import Extraction
from jointsdf.model.field import JointField
from jointsdf.training.module import JointSDFModule
from jointsdf.values import LabelledMesh
from jointsdf.viewing.export import fits_tensorboard, tensorboard_mesh

PREVIEW_COLUMNS = ("cd_l1", "nc", "miou")
MESH_RESOLUTIONS = (64, 48, 32, 24, 16, 8)  # tried in turn, where the run's own mesh is too large for the mesh tab


def extract(field: JointField, extraction: Extraction) -> LabelledMesh:
    """The field's labelled mesh, file frame."""
    return extraction.labelled_mesh(field.network_sdf, field.network_part, field.normalisation)


@dataclass(frozen=True)
class PreviewSettings:
    """When previews are made, and on which grid.

    Attributes:
        every: Steps between two; 0 for none.
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
    """Every so many steps: a coarse mesh, measured and pictured, in TensorBoard under `preview_<resolution>/`.

    Args:
        writer: Where to.
        truth: Ground truth, file frame.
        protocol: How to measure; a coarse one, since this is only a preview.
        settings: When, and on which grid.
        picture: (truth, prediction) -> image.
    """

    def __init__(
        self,
        writer: SummaryWriter,
        truth: LabelledMesh,
        protocol: Protocol,
        settings: PreviewSettings,
        picture: Callable[[LabelledMesh, LabelledMesh], UInt8[ndarray, "h w 3"]],
    ) -> None:
        self.writer, self.truth = writer, GroundTruth(truth, {"preview": protocol})
        self.every, self.extraction, self.picture = settings.every, Extraction(settings.resolution), picture

    def on_train_batch_end(self, trainer: Trainer, pl_module: LightningModule, *_: Any) -> None:
        """Measure when it is time, but not at the very end, which is measured in full."""
        step = trainer.global_step
        if step % self.every or step >= trainer.max_steps:
            return
        assert isinstance(pl_module, JointSDFModule)
        mesh = extract(pl_module.field, self.extraction)
        scores = self.truth.scores(mesh)["preview"]
        tag = f"preview_{self.extraction.resolution}"
        for column in PREVIEW_COLUMNS:
            if np.isfinite(scores.get(column, np.nan)):
                self.writer.add_scalar(f"{tag}/{column}", scores[column], step)
        self.writer.add_image(
            f"{tag}/truth_and_prediction", self.picture(self.truth.mesh, mesh), step, dataformats="HWC"
        )


def log_result(
    board: TensorBoardLogger,
    field: JointField,
    mesh: LabelledMesh,
    picture: UInt8[ndarray, "h w 3"],
    settings: Mapping[str, Any],
    scores: Mapping[str, float],
    step: int,
) -> None:
    """The finished run in TensorBoard: picture, mesh tab, hparams beside final metrics.

    Args:
        board: Where to.
        field: For the mesh tab, where the run's mesh is too large for it.
        mesh: The run's, file frame.
        picture: Ground truth and prediction side by side.
        settings: Plain values that name the run.
        scores: Final metrics.
        step: Steps done.
    """
    board.experiment.add_image("result/truth_and_prediction", picture, step, dataformats="HWC")
    _log_mesh(board.experiment, field, mesh, step)
    finite = {f"result/{name}": value for name, value in scores.items() if np.isfinite(value)}
    board.log_hyperparams(dict(settings), finite, step)  # SummaryWriter.add_hparams would make a run of its own
    board.finalize("success")


def _log_mesh(writer: SummaryWriter, field: JointField, mesh: LabelledMesh, step: int) -> None:
    """The mesh tab's entry; none for a field without a surface."""
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
