"""The joint field: trunk and head, queried in file units, and its file."""

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Int
from numpy import ndarray
from torch import Tensor

from jointsdf.errors import InputError, first_line
from jointsdf.model.composition import Evaluate, evaluate_fused, evaluate_with_graph, make_trunk
from jointsdf.model.field_file import half_state, reading
from jointsdf.model.fused.inference import TappedHead, infer
from jointsdf.model.heads import HEADS
from jointsdf.model.level_set import CHUNK, LevelSet
from jointsdf.model.outside import extend, onto_box, outside_box
from jointsdf.model.query import ANSWERS, FieldQuery, join, parse_names, parse_points, short_operations, warn_once
from jointsdf.model.sealed_file import load_sealed, save_sealed
from jointsdf.values import UNLABELLED, Normalisation


class JointField(LevelSet):
    """One shape's field: points in file units -> signed distance, part, logits, gradient.

    Args:
        trunk: Arguments of `SirenTrunk`; and `far`: `none`, or `grid`: away from the surface the field is that of a
            `FarGrid` of `far_resolution` points along each axis.
        head: `name` in `HEADS`, and that head's own arguments.
        part_ids: Original part ids, in the order of the logits.
        normalisation: File frame -> network frame.

    Attributes:
        about: What its file says of itself besides (`export/about.py`); empty for a run's own.

    Raises:
        InputError: An unknown head, or arguments that trunk or head do not take.
    """

    part_ids: Tensor

    def __init__(
        self,
        trunk: Mapping[str, Any],
        head: Mapping[str, Any],
        part_ids: Int[ndarray, " k"],
        normalisation: Normalisation,
    ) -> None:
        super().__init__()
        self.arguments, self.about = {"trunk": dict(trunk), "head": dict(head)}, dict[str, Any]()
        self.trunk, self.far = make_trunk(**trunk)
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

    def query(self, points: Any, *, what: str | Collection[str] = ANSWERS, differentiable: bool = False) -> FieldQuery:
        """Evaluate the field at points of the file frame, beside points and answers in constant memory.

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
        wanted = parse_names(what)
        if differentiable and not isinstance(points, Tensor):
            raise InputError("differentiable=True: give the points as a tensor, which alone keeps a graph")
        operations = nullcontext() if differentiable else short_operations()
        with torch.set_grad_enabled(differentiable), self._without_dropout(), operations:
            rows, as_given = parse_points(points)
            evaluate = evaluate_with_graph if differentiable else evaluate_fused
            columns: list[list[Any]] = [[] for _ in ANSWERS]
            for chunk in rows.split(CHUNK):
                inside = self._to_network(chunk)
                warn_once(self._said, chunk, inside, self.normalisation)
                for column, answer in zip(columns, self._answer(inside, wanted, evaluate), strict=True):
                    column.append(answer)
        return FieldQuery(*(None if column[0] is None else as_given(join(column)) for column in columns))

    def _answer(self, points: Float[Tensor, "n 3"], wanted: set[str], evaluate: Evaluate) -> FieldQuery:
        """Answers at points of the network frame, in file units."""
        projected = onto_box(points)
        values = evaluate(self.trunk, self.head, self.far, projected, wanted)
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
        values = evaluate_fused(self.trunk, self.head, self.far, self._tensor(points), {"sdf"})
        return np.asarray(values.sdf.cpu())

    def network_differential(self, points: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, " n"], Float[ndarray, "n 3"]]:
        """Signed distance and its gradient at points of the network frame, for the extraction."""
        values = evaluate_fused(self.trunk, self.head, self.far, self._tensor(points), {"sdf", "gradient"})
        assert values.grad is not None, "asked for"
        return values.sdf.cpu().numpy(), values.grad.cpu().numpy()

    def network_part(self, points: Float[ndarray, "n 3"]) -> Int[ndarray, " n"]:
        """Original part id at points of the network frame, for the extraction; -1 without a head."""
        tapped = TappedHead(self.trunk.tap, lambda features: self._parts(self.head(features)))
        layers, output = self.trunk.sine_layers, self.trunk.output
        with self._without_dropout():
            found = infer(layers, output, self._tensor(points), sdf=False, tapped=tapped).head
        assert found is not None
        return np.asarray(found.cpu())

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

    def save(self, path: Path, *, half: bool = False) -> None:
        """Write the field as plain values with a checksum (`model/sealed_file.py`).

        Args:
            path: The file.
            half: Whether to round the large matrices to float16, for half the bytes; `load` gives float32 again.

        Raises:
            InputError: A weight beyond the range of float16.
        """
        state = {"precision": "float16", "state": half_state(self)} if half else {"state": self.state_dict()}
        save_sealed({"format": 1, **self.arguments, **state, **({"about": self.about} if self.about else {})}, path)

    @classmethod
    def load(cls, path: str | Path) -> "JointField":
        """Read a field written by `save`, for inference on the CPU.

        Raises:
            InputError: The file is missing, damaged, or not a field.
        """
        with reading(Path(path)):
            state = (stored := load_sealed(path))["state"]
            normalisation = Normalisation(state["centre"].numpy(), float(state["scale"]))
            unfitted = {**stored["trunk"], "init": "siren"}  # the state replaces a fitted sphere, which takes seconds
            field = cls(unfitted, stored["head"], state["part_ids"].numpy(), normalisation)
            field.arguments["trunk"], field.about = stored["trunk"], dict(stored.get("about", {}))
            field.load_state_dict(state)
        return field.eval()
