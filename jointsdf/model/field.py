"""The joint field: trunk and head, queried in file units, and its file."""

import pickle
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Int
from numpy import ndarray
from torch import Tensor, nn

from jointsdf.errors import InputError, first_line
from jointsdf.model.heads import HEADS
from jointsdf.model.outside import extend, onto_box, outside_box
from jointsdf.model.query import (
    ANSWERS,
    Evaluate,
    FieldQuery,
    evaluate_fused,
    evaluate_with_graph,
    parse_names,
    parse_points,
    warn_once,
)
from jointsdf.model.trunk import SirenTrunk
from jointsdf.threads import over_threads, pieces
from jointsdf.values import UNLABELLED, Normalisation

CHUNK = 16384  # points evaluated at once: their record in the fused pass takes 170 MB
UNREADABLE = (  # errors of reading a damaged checkpoint, found by flipping bytes
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
    """One shape's field: points in file units -> signed distance, part, logits, gradient.

    Args:
        trunk: Arguments of `SirenTrunk`.
        head: `name` in `HEADS`, and that head's own arguments.
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
        arguments = dict(head)
        name = arguments.pop("name")
        if name not in HEADS:
            raise InputError(f"head={name}: accepted are {', '.join(HEADS)}")
        try:
            self.head = HEADS[name](self.trunk.feature_width, len(part_ids), **arguments)
        except InputError:
            raise
        except (TypeError, ValueError) as error:
            raise InputError(f"head {name} with {arguments}: {first_line(error)}") from error
        self._said: set[type[Warning]] = set()
        self.register_buffer("part_ids", torch.as_tensor(np.asarray(part_ids, dtype=np.int64)))
        self.register_buffer("centre", torch.as_tensor(np.asarray(normalisation.centre, dtype=np.float64)))
        self.register_buffer("scale", torch.tensor(float(normalisation.scale), dtype=torch.float64))

    @property
    def normalisation(self) -> Normalisation:
        """File frame -> network frame."""
        return Normalisation(self.centre.cpu().numpy(), float(self.scale))

    def query(self, points: Any, *, what: str | Collection[str] = ANSWERS, differentiable: bool = False) -> FieldQuery:
        """Evaluate the field at points of the file frame, in bounded memory.

        Points outside the training box get a lower bound of the distance and part -1, with one `OutsideBoxWarning`: the
        root of |x - p|^2 + f(p)^2, p the projection of x onto the box, so that minus its gradient leads to the shape.

        Args:
            points: A tensor, an array or nested lists of shape (n, 3), or (3,) for one point; file units. Types too
                coarse for a shape far from its origin give one `RoundedPointsWarning`.
            what: Some of `sdf`, `part`, `logits`, `gradient`; only these are computed.
            differentiable: Whether answers keep the graph to points and parameters; the points must be a tensor.

        Returns:
            Answers of the type of the points.

        Raises:
            InputError: The points or names cannot be used.

        >>> from jointsdf.values import UNMOVED
        >>> field = JointField({"width": 8, "depth": 2, "tap": 1}, {"name": "none"}, np.arange(0), UNMOVED)
        >>> answer = field.query([[0.0, 0.0, 0.5]], what="sdf")
        >>> len(answer.sdf), answer.part
        (1, None)
        """
        (rows, as_given), wanted = parse_points(points), parse_names(what)
        if differentiable and not isinstance(points, Tensor):
            raise InputError("differentiable=True: give the points as a tensor, which alone keeps a graph")
        with torch.set_grad_enabled(differentiable), self._without_dropout():
            inside = ((rows.to(self.centre) - self.centre) / self.scale).to(self.trunk.output.weight)
            warn_once(self._said, rows, inside, self.normalisation)
            evaluate = evaluate_with_graph if differentiable else evaluate_fused
            answers = [self._answer(chunk, wanted, evaluate) for chunk in inside.split(CHUNK)]
        columns = (None if column[0] is None else torch.cat(column) for column in zip(*answers, strict=True))
        return FieldQuery(*(None if column is None else as_given(column) for column in columns))

    def _answer(self, points: Float[Tensor, "n 3"], wanted: set[str], evaluate: Evaluate) -> FieldQuery:
        """Answers at points of the network frame, in file units."""
        projected = onto_box(points)
        values = evaluate(self.trunk, self.head, projected, wanted)
        sdf, grad = extend(points, projected, values.sdf, values.grad)
        part = None
        if "part" in wanted and values.logits is not None:
            part = self._parts(values.logits).masked_fill(outside_box(points), UNLABELLED)
        return FieldQuery(
            sdf * self.scale.to(sdf) if "sdf" in wanted else None,
            part,
            values.logits if "logits" in wanted else None,
            grad,
        )

    def network_sdf(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """Signed distance in network length units at points of the network frame, for the extraction."""
        inputs = self._tensor(points)
        sdf: ndarray = torch.cat(over_threads(self.trunk.sdf, inputs.tensor_split(pieces(inputs)))).cpu().numpy()
        return sdf

    def network_part(self, points: Float[ndarray, "n 3"]) -> Int[ndarray, " n"]:
        """Original part id at points of the network frame, for the extraction; -1 without a head."""
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
        """Evaluate the head without dropout within the block, whatever its mode."""
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
        """Write the field as plain values, which torch reads with `weights_only=True`."""
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
            unfitted = {**stored["trunk"], "init": "siren"}  # the state replaces a fitted sphere, which takes seconds
            field = cls(unfitted, stored["head"], state["part_ids"].numpy(), normalisation)
            field.arguments["trunk"] = stored["trunk"]
            field.load_state_dict(state)
        except UNREADABLE as error:
            raise InputError(
                f"{path}: not a readable field checkpoint ({first_line(error)}); run the fit again"
            ) from error
        return field.eval()
