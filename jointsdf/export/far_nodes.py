"""The grid away from the surface and its blend (`model/far_grid.py`) as ONNX operators."""

from typing import NamedTuple

import numpy as np

from jointsdf.export.graph import Graph
from jointsdf.model.far_grid import TAPS, FarGrid
from jointsdf.values import BOX

# Rows: coefficients of 1, t, t^2, t^3 of the four uniform cubic B-splines, and of their derivatives.
SPLINES = np.array([[1, -3, 3, -1], [4, 0, -6, 3], [1, 3, 3, -3], [0, 0, 0, 1]]) / 6
SLOPES = np.array([[-3, 6, -3, 0], [0, -12, 9, 0], [3, 6, -9, 0], [0, 0, 3, 0]]) / 6


class Blended(NamedTuple):
    """Names of the whole field's value and gradient."""

    sdf: str
    gradient: str


def blend(graph: Graph, far: FarGrid, points: str, near: Blended) -> Blended:
    """Blend the grid into the network's answers.

    Args:
        graph: Receives the nodes.
        far: The grid.
        points: In the box, network frame.
        near: Value, shape (n,), and gradient, shape (n, 3), of the network.
    """
    values, slopes = _spline(graph, far, points)
    width = graph.constant(far.outer - far.inner)
    way = graph.apply("Sub", graph.apply("Abs", values), graph.constant(far.inner))
    x = graph.apply("Clip", graph.apply("Div", way, width), graph.constant(0.0), graph.constant(1.0))
    share = _polynomial(graph, x, [0, 0, 0, 10, -15, 6])
    apart = graph.apply("Sub", values, near.sdf)
    sdf = graph.apply("Add", near.sdf, graph.apply("Mul", share, apart))
    growth = graph.apply("Div", _polynomial(graph, x, [0, 0, 30, -60, 30]), width)
    growth = graph.apply("Mul", graph.apply("Mul", growth, graph.apply("Sign", values)), apart)
    turned = graph.apply("Sub", slopes, near.gradient)
    turned = graph.apply("Mul", graph.unsqueeze(share, 1), turned)
    steeper = graph.apply("Mul", graph.unsqueeze(growth, 1), slopes)
    return Blended(sdf, graph.apply("Sum", near.gradient, turned, steeper))


def _spline(graph: Graph, far: FarGrid, points: str) -> tuple[str, str]:
    """Value and gradient of the spline at points of the box."""
    size, cell = far.resolution + 2, graph.constant(far.cell)
    at = graph.apply("Div", graph.apply("Add", points, graph.constant(BOX)), cell)
    last = graph.constant(far.resolution - 2)
    first = graph.apply("Clip", graph.apply("Floor", at), graph.constant(0.0), last)
    known = _neighbourhoods(graph, far, first, size)
    t = graph.unsqueeze(graph.apply("Sub", at, first), 2)
    powers = graph.apply("Concat", *(_power(graph, t, k) for k in range(4)), axis=2)
    x, y, z = _by_axis(graph, graph.apply("MatMul", powers, graph.constant(SPLINES.T)))
    dx, dy, dz = _by_axis(graph, graph.apply("MatMul", powers, graph.constant(SLOPES.T / far.cell)))
    along_z, slope_z = (_contract(graph, known, graph.unsqueeze(w, 1), 3) for w in (z, dz))
    plane, along_y, slope = (_contract(graph, of, w, 2) for of, w in ((along_z, y), (along_z, dy), (slope_z, y)))
    value, *gradient = (_contract(graph, of, w, 1) for of, w in ((plane, x), (plane, dx), (along_y, x), (slope, x)))
    return value, graph.apply("Concat", *(graph.unsqueeze(part, 1) for part in gradient), axis=1)


def _neighbourhoods(graph: Graph, far: FarGrid, first: str, size: int) -> str:
    """Coefficients about each point, shape (n, 4, 4, 4)."""
    steps = np.stack(np.meshgrid(*[np.arange(TAPS)] * 3, indexing="ij"), -1) @ [size * size, size, 1]
    corner = graph.apply("MatMul", graph.cast(first, np.float64), graph.constant([size * size, size, 1], np.float64))
    corner = graph.unsqueeze(graph.cast(corner, np.int64), 1, 2, 3)
    places = graph.apply("Add", corner, graph.constant(steps, np.int64))
    flat = graph.constant(far.coefficients.cpu().numpy().reshape(-1), np.int16)
    known = graph.cast(graph.apply("Gather", flat, places, axis=0), np.float32)
    return graph.apply("Mul", known, graph.constant(float(far.step)))


def _by_axis(graph: Graph, weights: str) -> list[str]:
    """Weights along x, y and z, shape (n, 4) each, of (n, 3, 4)."""
    return [graph.apply("Gather", weights, graph.constant(axis, np.int64), axis=1) for axis in range(3)]


def _contract(graph: Graph, known: str, weights: str, axis: int) -> str:
    """Weighted sum along the last axis, which is dropped; weights broadcast from (n, 4) or (n, 1, 4)."""
    spread = weights if axis == 1 else graph.unsqueeze(weights, 1)
    return graph.sum(graph.apply("Mul", known, spread), axis)


def _power(graph: Graph, value: str, exponent: int) -> str:
    return graph.apply("Pow", value, graph.constant(exponent))


def _polynomial(graph: Graph, x: str, coefficients: list[int]) -> str:
    """Polynomial by Horner's scheme, lowest coefficient first."""
    *rest, found = [graph.constant(c) for c in coefficients]
    for coefficient in reversed(rest):
        found = graph.apply("Add", graph.apply("Mul", found, x), coefficient)
    return found
