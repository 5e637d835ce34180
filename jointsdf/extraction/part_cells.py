"""Cells of the parts in space: a point belongs to the part whose surface is nearest.

Inside a solid these are the cells of a generalised Voronoi diagram of the parts' surfaces. The head's own answer there
is not taken: it learns on the surface alone, and nothing holds it in the depth. From any point of a cell the straight
way to its closest point stays in the cell, so every piece of it reaches its part's surface, and none floats within.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.ndimage import binary_dilation
from skimage.measure import marching_cubes

from jointsdf.geometry.distance import ClosestPoint
from jointsdf.geometry.mesh import unit, used_vertices
from jointsdf.phases import tell
from jointsdf.values import LabelledMesh

MARGIN = 3  # cells of the grid around the solid
OUTSIDE = 2.5  # cells outside the surface up to which points are told a part
REACH = 2  # cells from a part's own up to which its distance is asked
LEAST = 1e-3  # of a cell: values nearer to 0 than that would make faces without area
FLATTEST = 1e-6  # difference of two directions below which they are one

Sdf = Callable[[Float[ndarray, "n 3"]], Float[ndarray, " n"]]


@dataclass(frozen=True)
class Cutter:
    """A closed surface around the cell of one part, as far as the parts before it have left of it.

    Attributes:
        part: Its id.
        vertices: Positions, in the frame of the mesh.
        faces: Vertex indices, counter-clockwise seen from outside.
    """

    part: int
    vertices: Float[ndarray, "v 3"]
    faces: Int[ndarray, "f 3"]


@dataclass(frozen=True)
class _Candidates:
    """Points of the grid that may belong to a part.

    Attributes:
        rows: Of the points near the solid.
        ways: To each from its closest point of the part's surface; 0 where no other part is near.
    """

    rows: Int[ndarray, " m"]
    ways: Float[ndarray, "m 3"]


def cutters(mesh: LabelledMesh, sdf: Sdf, order: Int[ndarray, " k"], side: float) -> Iterator[Cutter]:
    """Surfaces that cut one part after another out of a solid; the last part is what is left.

    Each is the zero level set (marching cubes) of the difference between the distance to its part and that to the
    nearest of the later ones, divided by the length of its gradient, so that it is linear also where both closest
    points are nearly one. It runs on into the cells of the earlier parts, so that no two of them coincide.

    Args:
        mesh: Surface of the solid; every face has a label.
        sdf: Signed distance of the solid, negative inside, in the frame of the mesh.
        order: The parts, as they are cut.
        side: Of a cell of the grid.
    """
    low = mesh.vertices.min(axis=0) - MARGIN * side
    shape = tuple(np.ceil((np.ptp(mesh.vertices, axis=0)) / side).astype(int) + 2 * MARGIN + 1)
    points = low + side * np.indices(shape).reshape(3, -1).T
    near = np.flatnonzero(sdf(points) < OUTSIDE * side)
    row = np.full(len(points), -1)
    row[near] = np.arange(len(near))
    candidates = _candidates(mesh, points[near], order, row.reshape(shape))
    later = np.full((len(near), 3), np.inf)
    values: list[Float[ndarray, " m"]] = []
    for each in reversed(candidates):
        values.insert(0, _bisector(each.ways, later[each.rows], side))
        nearer = _lengths(each.ways) < _lengths(later[each.rows])
        later[each.rows[nearer]] = each.ways[nearer]
    for part, each, of_part in zip(order[:-1].tolist(), candidates, values, strict=False):
        yield _cutter(part, of_part, np.stack(np.unravel_index(near[each.rows], shape), axis=1), low, side)


def _bisector(ways: Float[ndarray, "m 3"], others: Float[ndarray, "m 3"], side: float) -> Float[ndarray, " m"]:
    """Signed distance to the points that are as far from one surface as from the others, at most a cell's side.

    Args:
        ways: From the closest points of the one surface.
        others: From those of the others; infinite where there are none.
        side: Of a cell.
    """
    alone = ~np.isfinite(others[:, 0])
    others = np.where(alone[:, None], 0, others)
    difference = _lengths(ways) - _lengths(others)
    slope = _lengths(unit(ways) - unit(others))
    found = np.divide(difference, slope, out=np.zeros_like(difference), where=slope > FLATTEST)
    found = np.where(alone, -side, np.clip(found, -side, side))
    least = LEAST * side
    return np.where(np.abs(found) < least, least, found)


def _lengths(ways: Float[ndarray, "m 3"]) -> Float[ndarray, " m"]:
    return np.asarray(np.linalg.norm(ways, axis=1))


def _candidates(
    mesh: LabelledMesh, points: Float[ndarray, "n 3"], order: Int[ndarray, " k"], row: Int[ndarray, "x y z"]
) -> list[_Candidates]:
    """Points near each part's cell, and the ways from the part where other parts are near as well."""
    labels = mesh.labels[ClosestPoint(mesh).query(points)[1]]
    rows, uses = [], np.zeros(len(points), dtype=np.int64)
    for part in order.tolist():
        own = np.zeros(row.shape, dtype=bool)
        own[row >= 0] = labels[row[row >= 0]] == part
        reached = row[binary_dilation(own, np.ones((3, 3, 3)), REACH)]
        rows.append(reached[reached >= 0])
        uses[rows[-1]] += 1
    found = []
    for number, (part, reached) in enumerate(zip(order.tolist(), rows, strict=True)):
        tell(number, len(order))
        ways, shared = np.zeros((len(reached), 3)), uses[reached] > 1
        used, faces = used_vertices(mesh.faces[mesh.labels == part], len(mesh.vertices))
        surface = LabelledMesh(mesh.vertices[used], faces, np.full(len(faces), part))
        asked = points[reached[shared]]
        ways[shared] = asked - ClosestPoint(surface).nearest(asked)
        found.append(_Candidates(reached, ways))
    return found


def _cutter(
    part: int, values: Float[ndarray, " m"], places: Int[ndarray, "m 3"], low: Float[ndarray, "3"], side: float
) -> Cutter:
    """Zero level set of the values at their places of the grid, which is outside everywhere else."""
    first = places.min(axis=0) - 1
    block = np.full(np.ptp(places, axis=0) + 3, side)
    block[tuple((places - first).T)] = values
    vertices, faces, *_ = marching_cubes(block, 0.0, allow_degenerate=True)
    return Cutter(part, low + side * (first + vertices.astype(np.float64)), faces.astype(np.int64))
