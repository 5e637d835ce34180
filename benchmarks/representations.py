"""What a fitted field costs and tells beside the mesh itself and beside an exact grid: bytes, seconds, errors.

The mesh is asked by libigl (closest face, exact distance). The grid has the exact distance at 128^3 points,
interpolated linearly, and the part of the nearest face at each.
Every side answers distance, gradient and part of the same points.
"""

import os
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

import jointsdf
from benchmarks.grids import trilinear
from benchmarks.table import Row
from jointsdf.evaluation.protocol import bounding_frame
from jointsdf.geometry.distance import network_distance
from jointsdf.geometry.sampling import sample_by_area
from jointsdf.metrics.distance import Distance
from jointsdf.model.field import JointField
from jointsdf.shapes import abc, load
from jointsdf.values import BOX, Normalisation, Shape

SHAPES = ("abc_0001", "abc_0016", "abc_0046")
SIZE = 128  # grid points along each axis
COLUMNS = ("sdf_relative_mean", "gradient_angle_median", "sdf_error_p99_b1", "gradient_angle_p95_b1")

# Signed distance, gradient and part id of points, everything in the unit frame.
Answers = tuple[Float[ndarray, " n"], Float[ndarray, "n 3"], Int[ndarray, " n"]]


@dataclass(frozen=True)
class Representation:
    """One way to keep a labelled shape.

    Attributes:
        ask: Points of the unit frame -> answers.
        kilobytes: On disk, uncompressed.
        seconds: To make it from the mesh, on two cores.
    """

    ask: Callable[[Float[ndarray, "n 3"]], Answers]
    kilobytes: float
    seconds: float


def rows(
    shapes: Sequence[str] = SHAPES, points: int = 20_000, size: int = SIZE, overrides: Sequence[str] = ()
) -> list[Row]:
    """The field against the mesh and against the grid, measure by measure.

    Args:
        shapes: Names; those of ABC are left out where their meshes are not at hand.
        points: Of each measure.
        size: Grid points along each axis.
        overrides: Of the fit.
    """
    root, found = os.environ.get("JOINTSDF_ABC", ""), []
    for name in shapes:
        if name in abc.catalogue() and not (root and abc.mesh_path(name, root).is_file()):
            continue
        shape = load(name, abc_root=root or "data/abc", abc_missing="error")
        fitted = jointsdf.fit(shape, overrides=overrides, quiet=True)
        frame, field = bounding_frame(shape.mesh), fitted.field
        box = frame.forward(field.normalisation.inverse(np.array([[-BOX] * 3, [BOX] * 3])))
        ours = of_field(field, frame, fitted.row.seconds["fit"])
        measured = measure(ours, shape, box, points)
        for peer, made in {
            "mesh": of_mesh(shape, frame),
            f"grid of {size}^3": of_grid(shape, frame, box, size),
        }.items():
            for what, theirs in measure(made, shape, box, points).items():
                value = measured[what]
                found.append(
                    Row(f"{name}: field, {what}", peer, value, theirs, "", value / theirs if theirs else np.nan)
                )
    return found


def measure(made: Representation, shape: Shape, box: Float[ndarray, "2 3"], points: int) -> dict[str, float]:
    """Size, time, errors as a distance, and share of wrong parts at points of the surface."""
    frame = bounding_frame(shape.mesh)
    exact = network_distance(shape, frame)
    generator = np.random.default_rng(0)
    anywhere = generator.uniform(*box, (points, 3))
    made.ask(anywhere[:100])
    start = time.perf_counter()
    made.ask(anywhere)
    microseconds = 1e6 * (time.perf_counter() - start) / points
    scores = Distance(points)(lambda at: made.ask(at)[:2], exact, box)
    vertices, faces = frame.forward(shape.mesh.vertices), shape.mesh.faces
    on, chosen = sample_by_area(vertices, faces, np.ones(len(faces)), points, generator)
    wrong = float(np.mean(made.ask(on)[2] != shape.mesh.labels[chosen]))
    sizes = {"kilobytes": made.kilobytes, "seconds to make": made.seconds, "microseconds a query": microseconds}
    return sizes | {column: scores[column] for column in COLUMNS} | {"wrong parts": wrong}


def of_mesh(shape: Shape, frame: Normalisation) -> Representation:
    """The mesh, with float32 vertices, int32 corners and a byte for each label."""
    start = time.perf_counter()
    exact = network_distance(shape, frame)
    seconds = time.perf_counter() - start

    def ask(points: Float[ndarray, "n 3"]) -> Answers:
        distances = exact.signed(points)
        return distances, exact.gradients(points, distances), shape.mesh.labels[exact.closest_face(points)]

    return Representation(ask, (12 * len(shape.mesh.vertices) + 13 * len(shape.mesh.faces)) / 1000, seconds)


def of_grid(shape: Shape, frame: Normalisation, box: Float[ndarray, "2 3"], size: int) -> Representation:
    """A grid of float32 distances and a byte for each label."""
    start = time.perf_counter()
    exact = network_distance(shape, frame)
    axes = [np.linspace(low, high, size) for low, high in box.T]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    field = trilinear(exact.signed(places).reshape((size,) * 3), *box)
    parts = shape.mesh.labels[exact.closest_face(places)].reshape((size,) * 3)
    seconds = time.perf_counter() - start

    def ask(points: Float[ndarray, "n 3"]) -> Answers:
        nearest = np.clip(np.rint((points - box[0]) / (box[1] - box[0]) * (size - 1)).astype(np.int64), 0, size - 1)
        return *field(points), parts[tuple(nearest.T)]

    return Representation(ask, 5 * size**3 / 1000, seconds)


def of_field(field: JointField, frame: Normalisation, seconds: float) -> Representation:
    """The fitted field, as its file holds it."""

    def ask(points: Float[ndarray, "n 3"]) -> Answers:
        found = field.query(frame.inverse(points), what=("sdf", "gradient", "part"))
        return found.sdf.astype(np.float64) / frame.scale, found.gradient.astype(np.float64), found.part

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "field.ckpt"
        field.save(path)
        return Representation(ask, path.stat().st_size / 1000, seconds)
