"""Queries of a field, against the peak: the time of their matrix products alone, and of their sines alone.

Counted are the products of a point's values with the weights of trunk and head, 2 FLOP for each weight, once for the
value and once more for the gradient, whose reverse mode multiplies by the same matrices transposed. The other side
multiplies matrices of these sizes, nothing else, in pieces of as many points on as many threads. Seconds
are those of the processor, of all threads together.
"""

import time
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
import torch
from torch import Tensor, nn

from benchmarks.table import Row, interleaved, machine
from jointsdf.model.field import JointField
from jointsdf.model.fused.evaluate import evaluate
from jointsdf.model.fused.inference import PIECE
from jointsdf.model.layers import cosine, sine_
from jointsdf.threads import over_threads
from jointsdf.values import BOX, UNMOVED

TARGET = 0.7
LARGE = 30_000  # points from which something is claimed
HEAD = {"name": "siren", "widths": [256, 128], "omega": 30.0}
KINDS = {  # answers of a query
    "values": ("sdf",),
    "values, gradient": ("sdf", "gradient"),
    "values, gradient, logits, part": ("sdf", "gradient", "logits", "part"),
}


def rows(points: int = 32_768, repetitions: int = 5) -> list[Row]:
    """Every kind of query, at the default size, beside its products, its sines, and the training's pass."""
    field = JointField({}, HEAD, np.arange(6), UNMOVED).eval()
    return [row for kind in KINDS for row in _rows(field, kind, points, repetitions)]


def _rows(field: JointField, kind: str, points: int, repetitions: int) -> list[Row]:
    where = field.normalisation.inverse(np.random.default_rng(0).uniform(-BOX, BOX, (points, 3)))
    shapes = product_shapes(field, KINDS[kind])
    sides: dict[str, tuple[str, Callable[[], object]]] = {
        "ours": ("default", lambda: field.query(where, what=KINDS[kind])),
        "matrix products alone, torch's own": ("default", lambda: multiply(shapes, points)),
        "matrix products alone, onednn": ("onednn", lambda: multiply(shapes, points)),
        "sines and cosines alone": ("default", lambda: waves(field, KINDS[kind], points)),
        "the training's pass, with its record": ("default", lambda: recorded(field, where, KINDS[kind])),
    }
    timed = (partial(_on_machine, *side) for side in sides.values())
    taken = interleaved(repetitions, *timed, clock=time.process_time)
    ours, *others = (seconds / points * 1e6 for seconds in taken)
    name = f"query: {kind} ({flop(shapes) / 1e6:.2f} MFLOP)"
    return [
        Row(name, against, ours, other, "core us", other / ours, TARGET if claimed(against, points) else None)
        for against, other in zip(list(sides)[1:], others, strict=True)
    ]


def claimed(against: str, points: int) -> bool:
    """Whether a share of this is a target."""
    return against.startswith("matrix products") and points >= LARGE


def _on_machine(matmul: str, side: Callable[[], object]) -> None:
    with machine(torch.get_num_threads(), matmul):
        side()


def product_shapes(field: JointField, what: Sequence[str]) -> list[tuple[int, int]]:
    """Rows and columns of every matrix that a point's values are multiplied by, in the order of the passes."""
    trunk = [layer.linear.weight for layer in field.trunk.sine_layers] + [field.trunk.output.weight]
    head = [module.weight for module in field.head.modules() if isinstance(module, nn.Linear)]
    shapes = [(weight.shape[1], weight.shape[0]) for weight in trunk]
    if "gradient" in what:
        shapes += [(rows, columns) for columns, rows in reversed(shapes[:-1])]
    return shapes + [(weight.shape[1], weight.shape[0]) for weight in head if "logits" in what]


def flop(shapes: Sequence[tuple[int, int]]) -> int:
    """Of one point."""
    return sum(2 * rows * columns for rows, columns in shapes)


def multiply(shapes: Sequence[tuple[int, int]], points: int) -> None:
    """Nothing but the products, each from one matrix of random values to another."""
    generator = torch.Generator().manual_seed(0)
    weights = [torch.randn(shape, generator=generator) for shape in shapes]
    largest = max(max(shape) for shape in shapes)

    def run(piece: Tensor) -> None:
        left, right = torch.ones(2, PIECE * largest)
        for weight in weights:
            rows, columns = weight.shape
            into = right[: len(piece) * columns].view(-1, columns)
            torch.mm(left[: len(piece) * rows].view(-1, rows), weight, out=into)

    over_threads(run, torch.empty(points, 0).split(PIECE))


def waves(field: JointField, what: Sequence[str], points: int) -> None:
    """Nothing but the sines of trunk and head, and the cosines of the gradient."""
    trunk = [layer.linear.out_features for layer in field.trunk.sine_layers]
    head = [module.linear.out_features for module in field.head.modules() if hasattr(module, "omega")]
    sines = trunk + (head if "logits" in what else [])
    cosines = trunk if "gradient" in what else []
    start = 10 * torch.randn(PIECE * max(sines), generator=torch.Generator().manual_seed(0))

    def run(piece: Tensor) -> None:
        values, out = start.clone(), torch.empty_like(start)
        for width in cosines:
            cosine(values[: len(piece) * width], out[: len(piece) * width])
        for width in sines:
            sine_(values[: len(piece) * width])

    over_threads(run, torch.empty(points, 0).split(PIECE))


def recorded(field: JointField, where: np.ndarray, what: Sequence[str]) -> None:
    """The same answers by the pass of the training, which keeps what its backward half would need."""
    points = torch.as_tensor(field.normalisation.forward(where), dtype=torch.float32)
    tap = field.trunk.tap if "logits" in what else None
    with torch.no_grad():
        for piece in points.split(16384):
            found = evaluate(field.trunk.sine_layers, field.trunk.output, piece, grad="gradient" in what, tap=tap)
            if found.feature is not None:
                field.head(torch.cat([found.feature, piece], -1))
