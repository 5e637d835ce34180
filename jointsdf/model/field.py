"""The joint field: trunk + head, asked in file units, and its file."""

import pickle
import warnings
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from torch import Tensor, nn

from jointsdf.errors import InputError, first_line
from jointsdf.model.fused.evaluate import evaluate
from jointsdf.model.heads import HEADS
from jointsdf.model.query import WHAT, FieldQuery, OutsideBoxWarning, points_of, wanted_of
from jointsdf.model.trunk import SirenTrunk
from jointsdf.threads import over_threads, pieces
from jointsdf.values import BOX, UNLABELLED, Normalisation

CHUNK = 16384  # points evaluated at once: their record in the fused pass takes 170 MB
ROUNDING = 1e-6  # of the box's size, before a point counts as outside
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
        self._warned = False
        self.register_buffer("part_ids", torch.as_tensor(np.asarray(part_ids, dtype=np.int64)))
        self.register_buffer("centre", torch.as_tensor(np.asarray(normalisation.centre, dtype=np.float64)))
        self.register_buffer("scale", torch.tensor(float(normalisation.scale), dtype=torch.float64))

    @property
    def normalisation(self) -> Normalisation:
        """File frame -> network frame."""
        return Normalisation(self.centre.cpu().numpy(), float(self.scale))

    def query(self, points: Any, *, what: str | Collection[str] = WHAT, differentiable: bool = False) -> FieldQuery:
        """Ask the field at points in the file frame, in bounded memory.

        Points outside the training box are answered by extrapolation, with part -1, and a warning says so once.

        Args:
            points: A tensor, an array or nested lists of shape (n, 3), or (3,) for one point; file units.
            what: Names of the answers wanted, of `sdf`, `part`, `logits`, `gradient`; only these are computed.
            differentiable: Whether answers keep the graph to the points and the parameters. Takes a tensor.

        Returns:
            Answers of the kind of the points.

        Raises:
            InputError: Points or names that cannot be used.

        >>> from jointsdf.values import UNMOVED
        >>> field = JointField({"width": 8, "depth": 2, "tap": 1}, {"name": "none"}, np.arange(0), UNMOVED)
        >>> answer = field.query([[0.0, 0.0, 0.5]], what="sdf")
        >>> len(answer.sdf), answer.part
        (1, None)
        """
        rows, as_given = points_of(points)
        wanted = wanted_of(what)
        if differentiable and not isinstance(points, Tensor):
            raise InputError("differentiable=True: give the points as a tensor, which alone keeps a graph")
        with torch.set_grad_enabled(differentiable), self._without_dropout():
            inside = ((rows.to(self.centre) - self.centre) / self.scale).to(self.trunk.output.weight)
            self._warn_outside(inside)
            ask = self._ask_with_graph if differentiable else self._ask
            answers = [ask(chunk, wanted) for chunk in inside.split(CHUNK)]
        columns = (None if column[0] is None else torch.cat(column) for column in zip(*answers, strict=True))
        return FieldQuery(*(None if column is None else as_given(column) for column in columns))

    def _warn_outside(self, points: Float[Tensor, "n 3"]) -> None:
        """Warn of points outside the training box, once."""
        if self._warned or not bool(_outside(points).any()):
            return
        self._warned = True
        warnings.warn(
            "points outside the training box: the field was not trained there, its distances are extrapolated and its "
            "parts -1 (said once)",
            OutsideBoxWarning,
            stacklevel=3,
        )

    def _ask(self, points: Float[Tensor, "n 3"], wanted: set[str]) -> FieldQuery:
        """Answers by the fused pass, of which a value alone is the cheapest."""
        if wanted == {"sdf"}:
            sdf = torch.cat(over_threads(self.trunk.sdf, points.tensor_split(pieces(points))))
            return FieldQuery(sdf * self.scale.to(sdf))
        tap = self.trunk.tap if wanted & {"part", "logits"} else None
        found = evaluate(self.trunk.sine_layers, self.trunk.output, points, grad="gradient" in wanted, tap=tap)
        logits = None if found.feature is None else self.head(torch.cat([found.feature, points], -1))
        return self._answer(points, wanted, found.sdf, logits, found.grad)

    def _ask_with_graph(self, points: Float[Tensor, "n 3"], wanted: set[str]) -> FieldQuery:
        """Answers by plain autograd, differentiable any number of times."""
        if "gradient" in wanted and not points.requires_grad:
            points = points.detach().requires_grad_()
        sdf, features = self.trunk(points)
        grad = torch.autograd.grad(sdf.sum(), points, create_graph=True)[0] if "gradient" in wanted else None
        logits = self.head(features) if wanted & {"part", "logits"} else None
        return self._answer(points, wanted, sdf, logits, grad)

    def _answer(
        self,
        points: Float[Tensor, "n 3"],
        wanted: set[str],
        sdf: Float[Tensor, " n"],
        logits: Float[Tensor, "n k"] | None,
        grad: Float[Tensor, "n 3"] | None,
    ) -> FieldQuery:
        part = None
        if "part" in wanted and logits is not None:
            part = self._parts(logits).masked_fill(_outside(points), UNLABELLED)
        return FieldQuery(
            sdf * self.scale.to(sdf) if "sdf" in wanted else None, part, logits if "logits" in wanted else None, grad
        )

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
    def load(cls, path: str | Path) -> "JointField":
        """Read a field written by `save`, for inference on the CPU.

        Raises:
            InputError: The file is missing, truncated, or not a field.
        """
        path = Path(path)
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


def _outside(points: Float[Tensor, "n 3"]) -> Bool[Tensor, " n"]:
    """Points of the network frame outside the training box."""
    return (points.abs() > BOX * (1 + ROUNDING)).any(dim=1)
