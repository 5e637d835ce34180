"""How round a fitted field is at the true creases: `python -m benchmarks.creases RUN_FOLDER ... [--write]`.

No mesh is extracted: zero level set and normals are the field's own, in the section across the crease. At points
uniform along the creases of the truth, b the bisector of the normals of both sides, theta the angle between these:

    gap     distance from the point to the zero level set along b, positive where the corner is rounded (cut off where
            it is convex, filled where it is concave)
    radius  arc length over which the field's normal turns the middle half of theta, divided by theta / 2

A rounding of radius r has the gap r (1 / cos(theta / 2) - 1). Only clear points count: nothing but the two sides is
within `CLEAR` of them. Lengths are percent of the longest side, and cells of the run's grid.
"""

import argparse
import shlex
import sys
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float
from numpy import ndarray

from benchmarks.sections import gaps, radii
from benchmarks.table import append
from jointsdf.evaluation.protocol import bounding_frame
from jointsdf.extraction.resolution import cell_size
from jointsdf.geometry.creases import REACH, find_creases
from jointsdf.geometry.distance import network_distance
from jointsdf.model.field import JointField
from jointsdf.runs.folder import FIELD, grid_of, read_result
from jointsdf.shapes.stored import stored_mesh_truth
from jointsdf.values import LabelledMesh

RESULTS = Path(__file__).with_name("creases.csv")
CLEAR, WRONG = 0.005, 0.03  # of the longest side; largest error of a wedge's distance at that distance, relative to it
POINTS = 1000  # along the creases of a shape
ANGLES = (0, 70, 110, 180)  # degrees, ends of the classes

Signed = Callable[[Float[ndarray, "n 3"]], Float[ndarray, " n"]]


class Edges(NamedTuple):
    """Points on true creases, in the unit frame, where the longest side is 1.

    Attributes:
        points: On the creases.
        bisectors: Unit vectors between the normals of both sides, outwards.
        across: Unit vectors across the crease, perpendicular to the bisectors.
        angles: Between the two normals, radians.
        convex: Whether the solid is at the inside of the turn.
        clear: Whether nothing else is near.
    """

    points: Float[ndarray, "n 3"]
    bisectors: Float[ndarray, "n 3"]
    across: Float[ndarray, "n 3"]
    angles: Float[ndarray, " n"]
    convex: Bool[ndarray, " n"]
    clear: Bool[ndarray, " n"]


class Rounding(NamedTuple):
    """What a field makes of the clear points of a shape.

    Attributes:
        gap: Percent of the longest side, NaN where there is no zero level set near.
        radius: Percent of the longest side, infinite where the normal does not turn that far.
        cell: Of the run's grid, percent of the longest side.
        angles: Between the normals of both sides, degrees.
        convex: Whether the solid is at the inside of the turn.
        clear: Share of the creases that are clear.
        network: Share of the points at which the field is the network's alone.
    """

    gap: Float[ndarray, " n"]
    radius: Float[ndarray, " n"]
    cell: Float[ndarray, " n"]
    angles: Float[ndarray, " n"]
    convex: Bool[ndarray, " n"]
    clear: float
    network: float


def true_edges(mesh: LabelledMesh, signed: Signed, count: int) -> Edges:
    """Draw points uniform along the creases of a mesh.

    At the distance CLEAR outwards and inwards along the bisector, the distance to a wedge is CLEAR where the wedge
    turns away, and CLEAR cos(theta / 2) where it turns towards the point: this tells convex from concave, and whether
    the wedge is alone.

    Args:
        mesh: Unit frame.
        signed: Its signed distance.
        count: Number of points; none are drawn where there is no crease.
    """
    creases = find_creases(mesh, REACH)
    generator = np.random.default_rng(0)
    reached = np.cumsum(np.linalg.norm(creases.ends - creases.starts, axis=1))
    count = count if len(reached) else 0
    piece = np.minimum(np.searchsorted(reached, generator.random(count) * reached[-1:]), len(reached) - 1)
    points = creases.starts[piece] + generator.random((count, 1)) * (creases.ends - creases.starts)[piece]
    one, other = creases.normals[piece].swapaxes(0, 1)
    bisectors = (one + other) / np.linalg.norm(one + other, axis=1, keepdims=True)
    across = (one - other) / np.linalg.norm(one - other, axis=1, keepdims=True)
    angles = creases.angles[piece]
    outwards, inwards = (np.abs(signed(points + sign * CLEAR * bisectors)) / CLEAR for sign in (1, -1))
    convex = outwards > inwards
    away, towards = np.where(convex, outwards, inwards), np.where(convex, inwards, outwards)
    clear = (np.abs(away - 1) < WRONG) & (np.abs(towards - np.cos(angles / 2)) < WRONG)
    return Edges(points, bisectors, across, angles, convex, clear)


def measure(folder: Path) -> Rounding:
    """Measure the stored field of a finished run at the creases of its ground truth."""
    _, shape = stored_mesh_truth(folder)
    field, frame = JointField.load(folder / FIELD), bounding_frame(shape.mesh)
    mesh = LabelledMesh(frame.forward(shape.mesh.vertices), shape.mesh.faces, shape.mesh.labels)
    edges = true_edges(mesh, network_distance(shape, frame).signed, POINTS)
    share = float(edges.clear.mean()) if len(edges.clear) else 0.0
    edges = Edges(*(column[edges.clear] for column in edges))

    def differential(points: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, " n"], Float[ndarray, "n 3"]]:
        found = field.query(frame.inverse(points), what=("sdf", "gradient"))
        return found.sdf.astype(np.float64) / frame.scale, found.gradient.astype(np.float64)

    outward = gaps(lambda points: differential(points)[0], edges.points, edges.bisectors)
    found = np.isfinite(outward)
    start = edges.points + np.where(found, outward, 0)[:, None] * edges.bisectors
    radius = radii(differential, start, edges.bisectors, edges.across, edges.angles, edges.convex)
    cell = 100 * cell_size(grid_of(folder, read_result(folder))) * field.normalisation.scale / frame.scale
    return Rounding(
        gap=100 * np.where(edges.convex, -outward, outward),
        radius=100 * np.where(found, radius, np.nan),
        cell=np.full(len(radius), cell),
        angles=np.degrees(edges.angles),
        convex=edges.convex,
        clear=share,
        network=_network_alone(field, field.normalisation.forward(frame.inverse(start))),
    )


def _network_alone(field: JointField, points: Float[ndarray, "n 3"]) -> float:
    """Share of points, network frame, at which the grid for the space away from the surface has no part."""
    if field.far is None or not len(points):
        return 1.0
    with torch.no_grad():
        values = field.far(torch.from_numpy(points).float())
    return float((values.abs() <= field.far.inner).float().mean())


def classes(name: str, found: Rounding) -> list[dict[str, float | str]]:
    """Median and 95th percentile over the points of each class of angles, convex and concave, that has ten of them."""
    rows: list[dict[str, float | str]] = []
    for turn, of_turn in (("convex", found.convex), ("concave", ~found.convex)):
        for low, high in pairwise(ANGLES):
            chosen = of_turn & (found.angles >= low) & (found.angles < high)
            if chosen.sum() < 10:
                continue
            gap, radius, cell = found.gap[chosen], found.radius[chosen], found.cell[chosen]
            row: dict[str, float | str] = {"shape": name, "turn": turn, "degrees": f"{low or 32}-{high}"}
            row |= {"points": int(chosen.sum()), "clear": found.clear, "network": found.network}
            row |= {f"gap_{percent}": _percentile(gap, percent) for percent in (5, 50, 95)}
            row |= {f"gap_cells_{percent}": _percentile(gap / cell, percent) for percent in (50, 95)}
            row |= {f"radius_{percent}": _percentile(radius, percent) for percent in (50, 95)}
            row |= {f"radius_cells_{percent}": _percentile(radius / cell, percent) for percent in (50, 95)}
            rows.append(row | {"missing": float(np.isnan(gap).mean())})
    return rows


def _percentile(values: Float[ndarray, " n"], percent: float) -> float:
    known = values[~np.isnan(values)]
    return float(np.percentile(known, percent, method="nearest")) if len(known) else float("nan")


def pooled(found: Sequence[Rounding]) -> Rounding:
    """All points of several shapes together."""
    columns = [np.concatenate(column) for column in zip(*(each[:5] for each in found), strict=True)]
    return Rounding(*columns, *(float(np.mean([each[k] for each in found])) for k in (5, 6)))


def main(arguments: Sequence[str]) -> None:
    """Measure the fields of finished runs, print the classes, and append them to the rows where asked."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.creases", description=__doc__)
    parser.add_argument("folders", nargs="+", type=Path, help="folders of finished runs, named .../SHAPE/seedN")
    parser.add_argument("--write", action="store_true", help=f"append the rows to {RESULTS.name}")
    chosen = parser.parse_args(arguments)
    found = {str(folder): measure(folder) for folder in chosen.folders}
    rows = [row for name, each in found.items() for row in classes(Path(name).parent.name, each)]
    rows += classes("all", pooled(list(found.values())))
    if chosen.write and rows:
        append(RESULTS, rows, shlex.join(["python", "-m", "benchmarks.creases", *arguments]))
    for row in [{key: key for key in rows[0]} if rows else {}, *rows]:
        cells = (f"{value:.3g}" if isinstance(value, float) else str(value) for value in row.values())
        sys.stdout.write(" ".join(f"{cell:>10}" for cell in cells) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
