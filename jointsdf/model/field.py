"""The joint field: trunk + head, asked in file units, and its file."""

import pickle
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from jaxtyping import Float, Int
from numpy import ndarray
from torch import Tensor, nn

from jointsdf.errors import InputError, first_line
from jointsdf.model.derivatives import gradient, trace
from jointsdf.model.heads import HEADS
from jointsdf.model.trunk import SirenTrunk
from jointsdf.threads import over_threads, pieces
from jointsdf.values import UNLABELLED, Normalisation

CHUNK = 65536  # points evaluated at once
# What reading a damaged checkpoint can raise, found by feeding it flipped bytes.
UNREADABLE = (
    RuntimeError,
    LookupError,
    EOFError,
    TypeError,
    AttributeError,
    OSError,
    ValueError,
    pickle.UnpicklingError,
)


class FieldQuery(NamedTuple):
    """What a `JointField` answers, file frame.

    Attributes:
        sdf: Signed distance, file units, negative inside.
        part: Original part id; -1 for a field without a head.
        logits: Pre-softmax scores, columns in the order of `JointField.part_ids`.
        gradient: Gradient of the signed distance, dimensionless.
    """

    sdf: Float[Tensor, " n"]
    part: Int[Tensor, " n"]
    logits: Float[Tensor, "n k"]
    gradient: Float[Tensor, "n 3"]


class JointField(nn.Module):
    """One shape's fitted field: points in file units -> signed distance, part, logits, gradient.

    Args:
        trunk: Arguments of `SirenTrunk`.
        head: `name` in `HEADS` and that head's own arguments.
        part_ids: Original part ids, in the order of the logits.
        normalisation: File frame -> network frame.

    Raises:
        InputError: An unknown head, or arguments that trunk or head do not take.
    """

    centre: Tensor
    scale: Tensor
    part_ids: Tensor

    def __init__(
        self,
        trunk: Mapping[str, Any],
        head: Mapping[str, Any],
        part_ids: Int[ndarray, " k"],
        normalisation: Normalisation,
    ) -> None:
        super().__init__()
        self.arguments = {"trunk": dict(trunk), "head": dict(head)}
        self.trunk = SirenTrunk(**trunk)
        knobs = dict(head)
        name = knobs.pop("name")
        if name not in HEADS:
            raise InputError(f"head={name}: accepted are {', '.join(HEADS)}")
        try:
            self.head = HEADS[name](self.trunk.feature_width, len(part_ids), **knobs)
        except InputError:
            raise
        except (TypeError, ValueError) as error:
            raise InputError(f"head {name} with {knobs}: {first_line(error)}") from error
        self.register_buffer("part_ids", torch.as_tensor(np.asarray(part_ids, dtype=np.int64)))
        self.register_buffer("centre", torch.as_tensor(np.asarray(normalisation.centre, dtype=np.float64)))
        self.register_buffer("scale", torch.tensor(float(normalisation.scale), dtype=torch.float64))

    @property
    def normalisation(self) -> Normalisation:
        """File frame -> network frame."""
        return Normalisation(self.centre.cpu().numpy(), float(self.scale))

    @torch.no_grad()
    def query(self, points: Float[Tensor, "n 3"]) -> FieldQuery:
        """Everything the field knows at points in the file frame, in bounded memory."""
        answers = [self._query(chunk) for chunk in points.split(CHUNK)]
        return FieldQuery(*(torch.cat(column) for column in zip(*answers, strict=True)))

    def _query(self, points: Float[Tensor, "n 3"]) -> FieldQuery:
        parameter = self.trunk.output.weight
        inside = ((points.to(self.centre) - self.centre) / self.scale).to(parameter)
        traced = trace(self.trunk.sine_layers, self.trunk.output, inside, with_cosines=True)
        grad = gradient(self.trunk.sine_layers, self.trunk.output, traced)
        with self._without_dropout():
            logits: Tensor = self.head(torch.cat([traced.sines[self.trunk.tap - 1], inside], -1))
        return FieldQuery(traced.sdf * self.scale.to(parameter), self._parts(logits), logits, grad)

    def network_sdf(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """Signed distance, network frame to network length units, for the extraction."""
        inputs = self._tensor(points)
        sdf: ndarray = torch.cat(over_threads(self.trunk.sdf, inputs.tensor_split(pieces(inputs)))).cpu().numpy()
        return sdf

    def network_part(self, points: Float[ndarray, "n 3"]) -> Int[ndarray, " n"]:
        """Original part id at points in the network frame; -1 without a head."""
        inputs = self._tensor(points)
        with self._without_dropout():
            found = over_threads(
                lambda piece: self._parts(self.head(self.trunk(piece)[1])), inputs.tensor_split(pieces(inputs))
            )
        parts: ndarray = torch.cat(found).cpu().numpy()
        return parts

    def _tensor(self, points: Float[ndarray, "n 3"]) -> Float[Tensor, "n 3"]:
        parameter = self.trunk.output.weight
        return torch.as_tensor(points, dtype=parameter.dtype, device=parameter.device)

    @contextmanager
    def _without_dropout(self) -> Iterator[None]:
        """The head as it answers, whatever mode the module is in."""
        was_training = self.head.training
        self.head.eval()
        try:
            yield
        finally:
            self.head.train(was_training)

    def _parts(self, logits: Float[Tensor, "n k"]) -> Int[Tensor, " n"]:
        if logits.shape[1] == 0:
            return torch.full(logits.shape[:1], UNLABELLED, device=logits.device)
        return self.part_ids[logits.argmax(-1)]

    def save(self, path: Path) -> None:
        """Write the field as plain values, readable with `weights_only=True`."""
        torch.save({"format": 1, **self.arguments, "state": self.state_dict()}, path)

    @classmethod
    def load(cls, path: Path) -> "JointField":
        """Read a field written by `save`.

        Raises:
            InputError: The file is missing, truncated, or not a field.
        """
        if not path.is_file():
            raise InputError(f"{path}: no such field checkpoint; a finished run folder holds field.ckpt")
        try:
            stored = torch.load(path, map_location="cpu", weights_only=True)
            state = stored["state"]
            normalisation = Normalisation(state["centre"].numpy(), float(state["scale"]))
            unfitted = {**stored["trunk"], "init": "siren"}  # the sphere takes seconds, and the state replaces it
            field = cls(unfitted, stored["head"], state["part_ids"].numpy(), normalisation)
            field.arguments["trunk"] = stored["trunk"]
            field.load_state_dict(state)
        except UNREADABLE as error:
            raise InputError(
                f"{path}: not a readable field checkpoint ({first_line(error)}); run the fit again"
            ) from error
        return field.eval()
