"""A field as one ONNX graph: points in file units -> sdf, gradient, logits, part.

The graph answers what `JointField.query` answers. Points come as float64 and are mapped to the network frame before
they are rounded to float32, so that shapes far from their origin lose nothing. The gradient is the reverse sweep of
`model/fused/inference.py`, written out.
"""

from pathlib import Path
from typing import Any

import numpy as np

from jointsdf.export.about import as_text, describe
from jointsdf.export.far_nodes import Blended, blend
from jointsdf.export.graph import Graph
from jointsdf.export.layers import head_layers, sine_layers
from jointsdf.model.field import JointField
from jointsdf.model.outside import ROUNDING
from jointsdf.model.trunk import SirenTrunk
from jointsdf.runs.files import write_atomically
from jointsdf.values import BOX, UNLABELLED

POINTS, COUNT = "points", "n"


def write_onnx(field: JointField, path: Path) -> None:
    """Write the field as an ONNX model, atomically; its metadata are the entries of `describe`.

    Raises:
        InputError: The package onnx is not installed, or the head has no exported form.
        OSError: The file cannot be written.
    """
    graph, classes = Graph(), len(field.part_ids)
    about = {name: value if isinstance(value, str) else as_text(value) for name, value in describe(field).items()}
    outputs: list[tuple[str, Any, list[Any]]] = [("sdf", np.float32, [COUNT]), ("gradient", np.float32, [COUNT, 3])]
    if classes:
        outputs += [("logits", np.float32, [COUNT, classes]), ("part", np.int64, [COUNT])]
    _add_field(graph, field)
    write_atomically(path, graph.model([(POINTS, np.float64, [COUNT, 3])], outputs, about))


def _add_field(graph: Graph, field: JointField) -> None:
    """Add the nodes of all outputs."""
    moved = graph.apply("Sub", POINTS, graph.constant(field.centre.tolist(), np.float64))
    points = graph.cast(graph.apply("Div", moved, graph.constant(float(field.scale), np.float64)), np.float32)
    beyond = graph.apply("Greater", graph.apply("Abs", points), graph.constant(BOX * (1 + ROUNDING)))
    any_beyond = graph.apply("ReduceMax", graph.cast(beyond, np.float32), axes=[1], keepdims=1)
    outside = graph.cast(any_beyond, bool)
    clipped = graph.apply("Clip", points, graph.constant(-BOX), graph.constant(BOX))
    projected = graph.apply("Where", outside, clipped, points)
    near, features = _add_trunk(graph, field.trunk, projected)
    whole = near if field.far is None else blend(graph, field.far, projected, near)
    sdf, gradient = _extend(graph, points, projected, outside, whole)
    graph.apply("Mul", sdf, graph.constant(float(field.scale)), name="sdf")
    graph.apply("Identity", gradient, name="gradient")
    if len(field.part_ids):
        _add_parts(graph, field, features, outside)


def _add_trunk(graph: Graph, trunk: SirenTrunk, points: str) -> tuple[Blended, str]:
    """Value and gradient of the network, and the head's input [f; x]."""
    layers, cosines = sine_layers(trunk.sine_layers), []
    hidden = features = points
    for number, layer in enumerate(layers, 1):
        before, hidden = graph.dense(layer, hidden)
        cosines.append(graph.apply("Cos", before))
        features = hidden if number == trunk.tap else features
    output = trunk.output.weight.detach().cpu().numpy()
    offset = graph.constant(trunk.output.bias.detach().cpu().numpy())
    value = graph.squeeze(graph.apply("Gemm", hidden, graph.constant(output), offset, transB=1), 1)
    adjoint = graph.constant(output)
    for layer, cosine in zip(reversed(layers), reversed(cosines), strict=True):
        product = graph.apply("Mul", cosine, adjoint)
        adjoint = graph.apply("Gemm", product, graph.weight(layer), alpha=layer.omega)
    return Blended(value, adjoint), graph.apply("Concat", features, points, axis=1)


def _extend(graph: Graph, points: str, projected: str, outside: str, inside: Blended) -> tuple[str, str]:
    """The lower bound outside the box, and its gradient, as `model/outside.py`."""
    away, value, one = graph.apply("Sub", points, projected), graph.unsqueeze(inside.sdf, 1), graph.constant(1.0)
    squares = graph.apply("ReduceSumSquare", away, axes=[1], keepdims=1)
    squared = graph.apply("Add", squares, graph.apply("Mul", value, value))
    bound = graph.apply("Sqrt", graph.apply("Where", outside, squared, one))
    unmoved = graph.apply("Equal", away, graph.constant(0.0))
    kept = graph.apply("Where", unmoved, inside.gradient, graph.constant(0.0))
    turned = graph.apply("Div", graph.apply("Add", away, graph.apply("Mul", value, kept)), bound)
    sdf = graph.squeeze(graph.apply("Where", outside, bound, value), 1)
    return sdf, graph.apply("Where", outside, turned, inside.gradient)


def _add_parts(graph: Graph, field: JointField, features: str, outside: str) -> None:
    """Logits and original part ids."""
    values = [features]
    for layer in head_layers(field.head):
        chosen = [values[k] for k in layer.inputs]
        joined = chosen[0] if len(chosen) == 1 else graph.apply("Concat", *chosen, axis=1)
        values.append(graph.dense(layer, joined)[1])
    graph.apply("Identity", values[-1], name="logits")
    best = graph.apply("ArgMax", values[-1], axis=1, keepdims=0)
    ids = graph.constant(field.part_ids.tolist(), np.int64)
    part = graph.apply("Gather", ids, best, axis=0)
    unlabelled = graph.constant(UNLABELLED, np.int64)
    graph.apply("Where", graph.squeeze(outside, 1), unlabelled, part, name="part")
