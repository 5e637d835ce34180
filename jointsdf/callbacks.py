"""What happens beside the training: checkpoints that lose little, previews, and the final TensorBoard entries."""

import os
import pickle
import signal
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import torch
from jaxtyping import UInt8
from lightning import Callback, LightningModule, Trainer
from numpy import ndarray
from torch.utils.tensorboard import SummaryWriter

from jointsdf.evaluation import Protocol, evaluate
from jointsdf.extraction import Extraction
from jointsdf.module import JointSDFModule
from jointsdf.trunk import JointField
from jointsdf.values import InputError, LabelledMesh

PREVIEW_COLUMNS = ("cd_l1", "nc", "miou")


def extract(field: JointField, extraction: Extraction) -> LabelledMesh:
    """The field's labelled mesh, file frame."""
    return extraction.labelled_mesh(field.network_sdf, field.network_part, field.normalisation)


class Checkpoints(Callback):
    """Writes `path` every so many seconds and when the run is asked to stop, always between two steps, atomically.

    A first Ctrl-C or SIGTERM ends the run after the step in hand; a second one ends it at once.

    Args:
        path: The one checkpoint file.
        seconds: Between two writes: what kill -9 can cost.
    """

    def __init__(self, path: Path, seconds: float) -> None:
        self.path, self.seconds = path, seconds
        self.asked_to_stop: int | None = None
        self.saved_at = self.started_at = time.monotonic()
        self.seconds_before = 0.0
        self.previous: dict[int, Any] = {}

    @property
    def seconds_trained(self) -> float:
        """Seconds since the start of training, those before an interruption included."""
        return self.seconds_before + time.monotonic() - self.started_at

    def state_dict(self) -> dict[str, Any]:
        """What the checkpoint keeps of this callback."""
        return {"seconds_trained": self.seconds_trained}

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """Go on counting."""
        self.seconds_before = state_dict["seconds_trained"]

    def on_train_start(self, trainer: Trainer, pl_module: LightningModule) -> None:  # noqa: ARG002
        """Take over the two signals."""
        self.saved_at = self.started_at = time.monotonic()
        self.previous = {number: signal.signal(number, self._stop) for number in (signal.SIGINT, signal.SIGTERM)}

    def on_train_batch_end(self, trainer: Trainer, *_: Any) -> None:
        """Save when it is time.

        Raises:
            KeyboardInterrupt: Ctrl-C or SIGTERM came; the checkpoint is written.
        """
        due = time.monotonic() - self.saved_at >= self.seconds
        if due or self.asked_to_stop is not None:
            self.save(trainer)
        if self.asked_to_stop is not None:
            raise KeyboardInterrupt

    def on_train_end(self, trainer: Trainer, pl_module: LightningModule) -> None:  # noqa: ARG002
        """Save the fitted field, so that an interruption of what follows costs no training."""
        self.save(trainer)

    def teardown(self, trainer: Trainer, pl_module: LightningModule, stage: str) -> None:  # noqa: ARG002
        """Give the signals back."""
        for number, handler in self.previous.items():
            signal.signal(number, handler)
        self.previous = {}

    def save(self, trainer: Trainer) -> None:
        """Write the checkpoint and put it in place in one move."""
        part = self.path.with_suffix(".part")
        trainer.save_checkpoint(part)
        os.replace(part, self.path)
        self.saved_at = time.monotonic()

    def _stop(self, number: int, _: FrameType | None) -> None:
        if self.asked_to_stop is not None:
            raise KeyboardInterrupt
        self.asked_to_stop = number


def resumable(path: Path, module: JointSDFModule) -> Path | None:
    """The checkpoint to go on from; None where there is none.

    Raises:
        InputError: It is truncated, not a checkpoint, or of a field of another size.
    """
    if not path.is_file():
        return None
    try:
        state = torch.load(path, map_location="cpu", weights_only=True)["state_dict"]
    except (RuntimeError, KeyError, EOFError, TypeError, ValueError, pickle.UnpicklingError) as error:
        raise InputError(f"{path}: damaged checkpoint; resume=never starts the fit over") from error
    sizes = {name: tuple(tensor.shape) for name, tensor in module.state_dict().items()}
    for name in sizes.keys() | state.keys():
        stored = tuple(state[name].shape) if name in state else None
        if stored != sizes.get(name):
            raise InputError(
                f"{path}: checkpoint of another field ({name} is {stored}, not {sizes.get(name)}); resume=never starts over"
            )
    return path


class Preview(Callback):
    """Every so many steps: a coarse mesh, measured and pictured, in TensorBoard under `preview_<resolution>/`.

    Args:
        writer: Where to.
        truth: Ground truth, file frame.
        protocol: How to measure; a coarse one, since this is only a preview.
        extraction: A coarse grid.
        every: Steps.
        picture: (truth, prediction) -> image.
    """

    def __init__(
        self,
        writer: SummaryWriter,
        truth: LabelledMesh,
        protocol: Protocol,
        extraction: Extraction,
        every: int,
        picture: Callable[[LabelledMesh, LabelledMesh], UInt8[ndarray, "h w 3"]],
    ) -> None:
        self.writer, self.truth, self.protocol = writer, truth, protocol
        self.extraction, self.every, self.picture = extraction, every, picture

    def on_train_batch_end(self, trainer: Trainer, pl_module: LightningModule, *_: Any) -> None:
        """Measure when it is time, but not at the very end, which is measured in full."""
        step = trainer.global_step
        if step % self.every or step >= trainer.max_steps:
            return
        assert isinstance(pl_module, JointSDFModule)
        mesh = extract(pl_module.field, self.extraction)
        scores = evaluate(mesh, self.truth, None, {"preview": self.protocol})["preview"]
        tag = f"preview_{self.extraction.resolution}"
        for column in PREVIEW_COLUMNS:
            if np.isfinite(scores[column]):
                self.writer.add_scalar(f"{tag}/{column}", scores[column], step)
        self.writer.add_image(f"{tag}/truth_and_prediction", self.picture(self.truth, mesh), step, dataformats="HWC")


def log_result(
    writer: SummaryWriter,
    picture: UInt8[ndarray, "h w 3"],
    mesh: tuple[ndarray, ndarray, ndarray] | None,
    settings: Mapping[str, Any],
    scores: Mapping[str, float],
    step: int,
) -> None:
    """The finished run in TensorBoard: picture, mesh tab, hparams beside final metrics.

    Args:
        writer: Where to.
        picture: Ground truth and prediction side by side.
        mesh: Vertices, colours and faces for the mesh tab; None leaves it out.
        settings: Plain values that name the run.
        scores: Final metrics.
        step: Steps done.
    """
    writer.add_image("result/truth_and_prediction", picture, step, dataformats="HWC")
    if mesh is not None:
        vertices, colours, faces = (torch.as_tensor(array) for array in mesh)
        camera = {"cls": "PerspectiveCamera", "fov": 60, "position": [0, 0, 3.3]}
        lights = [
            {"cls": "AmbientLight", "color": "#ffffff", "intensity": 0.9},
            {"cls": "DirectionalLight", "color": "#ffffff", "intensity": 0.7, "position": [1, 2, 3]},
        ]
        writer.add_mesh(
            "result/mesh", vertices, colours, faces, {"camera": camera, "lights": lights}, global_step=step
        )
    finite = {f"result/{name}": value for name, value in scores.items() if np.isfinite(value)}
    writer.add_hparams(dict(settings), finite, run_name=".")
    writer.flush()
