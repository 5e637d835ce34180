"""Creases of a triangle mesh: edges across which its surface turns within a given length, whatever its faces' size.

The angle of a single mesh edge depends on the mesh: marching cubes chop a crease into two bends of half its angle, and
put slivers of any direction beside flat faces. So normals are averaged over a stretch of the surface on both sides.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from jointsdf.geometry.caching import cached_by_identity
from jointsdf.geometry.face_graph import CREASE, pair_sides
from jointsdf.geometry.mesh import face_normals, unit
from jointsdf.geometry.segments import points_along
from jointsdf.values import LabelledMesh

REACH = 0.002  # usual stretch of the surface on either side over which normals are averaged, of the longest side
BEND = np.radians(8.0)  # angle of a mesh edge from which it can be one of a crease: a quarter of `CREASE`
PIECE = 5.0  # longest piece of an edge with a section of its own, in reaches
CHUNK = 1 << 16  # sections that are marched at a time
STEPS = 200  # faces that a section crosses at most


@dataclass(frozen=True)
class Creases:
    """Pieces of the mesh edges that are creases, in the frame of the mesh.

    Attributes:
        starts: Ends of the pieces.
        ends: The other ends.
        normals: Mean unit normal on either side of each.
        edges: Vertex indices of the mesh edge that each is a piece of, the lower first.
    """

    starts: Float[ndarray, "n 3"]
    ends: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 2 3"]
    edges: Int[ndarray, "n 2"]

    @cached_property
    def angles(self) -> Float[ndarray, " n"]:
        """Angle by which the surface turns across each, radians."""
        return _angles(self.normals)


class Sides(NamedTuple):
    """Sides of the faces of a mesh (half-edges); side 3 f + k runs from corner k of face f to the next.

    Attributes:
        vertices: Of the mesh.
        ends: The two vertices of each side, in its face's order.
        normals: Of the faces, 0 where degenerate.
        twins: The side of the neighbouring face; -1 where there is none or more than one.
        pairs: The two sides at an edge, opposite ones where more than two faces meet.
    """

    vertices: Float[ndarray, "v 3"]
    ends: Int[ndarray, "h 2"]
    normals: Float[ndarray, "f 3"]
    twins: Int[ndarray, " h"]
    pairs: Int[ndarray, "p 2"]


def find_creases(mesh: LabelledMesh, reach: float) -> Creases:
    """Find the edges of a mesh across which the surface turns by more than `CREASE` (32 degrees).

    The surface is cut by the plane through a point of the edge and perpendicular to it; the angle is that between the
    means of the unit normals along the two branches of this section, each as long as `reach`:

        angle = angle(m_1, m_2),   m_i = integral of n over branch i

    Features narrower than the reach are averaged away, slivers do not count, and a fillet is a crease if it turns by
    that angle within the reach, i.e. if its radius is below 1.8 reaches. Edges of one face are no crease. Neighbouring
    faces must share vertex indices; they need not agree about the outside.

    Args:
        mesh: Any frame; open, non-manifold, with degenerate or repeated faces.
        reach: Length of a branch, mesh units.
    """
    sides = _sides(mesh)
    first, second = sides.pairs.T
    candidates, turned = _bends(sides)
    first, second, turned = first[candidates], second[candidates], turned[candidates]
    edges = np.sort(sides.ends[first], axis=1)
    starts, ends = _in_order(*sides.vertices[edges.T])
    middles, lengths, edge = points_along(starts, ends, PIECE * reach)
    along = (ends - starts)[edge]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    normals = np.zeros((len(edge), 2, 3))
    for begin in range(0, len(edge), CHUNK):
        part = slice(begin, begin + CHUNK)
        normals[part, 0] = _mean_normals(sides, first[edge[part]], middles[part], along[part], reach)
        normals[part, 1] = _mean_normals(sides, second[edge[part]], middles[part], along[part], reach)
    normals[:, 1] *= turned[edge, None]
    kept = _sharpest(middles, _angles(normals))
    half = along[kept] * lengths[kept, None] / 2
    return Creases(middles[kept] - half, middles[kept] + half, normals[kept], edges[edge[kept]])


def _in_order(
    one: Float[ndarray, "n 3"], other: Float[ndarray, "n 3"]
) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3"]]:
    """Ends of edges, the lexicographically lower first: edges at one place are cut into the same pieces."""
    first = (one != other).argmax(axis=1)[:, None]
    swapped = np.take_along_axis(one, first, 1) > np.take_along_axis(other, first, 1)
    return np.where(swapped, other, one), np.where(swapped, one, other)


def _sharpest(middles: Float[ndarray, "n 3"], angles: Float[ndarray, " n"]) -> Int[ndarray, " k"]:
    """Pieces with a crease, of those at one place the sharpest: edges of more than two faces, or of a needle."""
    kept = np.flatnonzero(angles > CREASE)
    order = kept[np.lexsort((-angles[kept], *middles[kept].T))]
    repeated = (middles[order[1:]] == middles[order[:-1]]).all(axis=1)
    return order[np.concatenate([[True], ~repeated])[: len(order)]]


def _angles(normals: Float[ndarray, "n 2 3"]) -> Float[ndarray, " n"]:
    one, other = normals.swapaxes(0, 1)
    return np.arctan2(np.linalg.norm(np.cross(one, other), axis=1), np.einsum("nd,nd->n", one, other))


@cached_by_identity
def _sides(mesh: LabelledMesh) -> Sides:
    faces = mesh.faces.astype(np.int64)
    ends, pairs, uses = _pairs(faces, len(mesh.vertices))
    if (uses > 1).any():  # as beside a face that is there twice
        faces = faces[np.unique(np.sort(faces, axis=1), axis=0, return_index=True)[1]]
        ends, pairs, uses = _pairs(faces, len(mesh.vertices))
    single = (uses[pairs] == 1).all(axis=1)
    twins = np.full(len(ends), -1)
    twins[pairs[single, 0]], twins[pairs[single, 1]] = pairs[single, 1], pairs[single, 0]
    vertices = mesh.vertices.astype(np.float64)
    return Sides(vertices, ends, face_normals(vertices, faces), twins, pairs)


def _pairs(
    faces: Int[ndarray, "f 3"], num_vertices: int
) -> tuple[Int[ndarray, "h 2"], Int[ndarray, "p 2"], Int[ndarray, " h"]]:
    """Ends of the sides, the pairs of sides, and the number of pairs that each side is in."""
    ends = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    pairs = np.stack(pair_sides(ends, num_vertices), axis=1)
    return ends, pairs, np.bincount(pairs.reshape(-1), minlength=len(ends))


def _bends(sides: Sides) -> tuple[Bool[ndarray, " p"], Float[ndarray, " p"]]:
    """Pairs of sides at which there may be a crease, and -1 for those whose faces disagree about the outside."""
    first, second = sides.pairs.T
    turned = np.where(sides.ends[first, 0] == sides.ends[second, 0], -1.0, 1.0)
    cosines = turned * np.einsum("pd,pd->p", sides.normals[first // 3], sides.normals[second // 3])
    return cosines < np.cos(BEND), turned


def _mean_normals(
    sides: Sides, begin: Int[ndarray, " n"], points: Float[ndarray, "n 3"], along: Float[ndarray, "n 3"], reach: float
) -> Float[ndarray, "n 3"]:
    """Direction of the integral of the unit normal along plane sections of the surface, marched from face to face.

    Args:
        sides: Of the mesh.
        begin: The side that each section begins at, into its face.
        points: Where on the side.
        along: Unit normal of the plane of each section: the direction of the side, either way.
        reach: Length of a section, which ends earlier at the border of an open mesh.
    """
    total = np.zeros_like(points)
    who, side, place = np.arange(len(begin)), begin, points
    left, sign = np.full(len(begin), reach), np.ones(len(begin))
    for _ in range(STEPS):
        face, corner = np.divmod(side, 3)
        onwards, back = 3 * face + (corner + 1) % 3, 3 * face + (corner + 2) % 3
        height = [
            np.einsum("nd,nd->n", sides.vertices[sides.ends[k, 0]] - points[who], along[who]) for k in (side, back)
        ]
        leaving = np.where((height[0] >= 0) == (height[1] >= 0), onwards, back)
        place, before = _crossing(sides, leaving, points[who], along[who]), place
        step = np.minimum(np.linalg.norm(place - before, axis=1), left)
        total[who] += (sign * step)[:, None] * sides.normals[face]
        side, left = sides.twins[leaving], left - step
        sign = np.where(sides.ends[leaving, 0] == sides.ends[side, 0], -sign, sign)
        going = (left > 0) & (side >= 0)
        who, side, place, left, sign = (array[going] for array in (who, side, place, left, sign))
        if len(who) == 0:
            break
    return unit(total)


def _crossing(
    sides: Sides, side: Int[ndarray, " n"], points: Float[ndarray, "n 3"], normals: Float[ndarray, "n 3"]
) -> Float[ndarray, "n 3"]:
    """Points where sides pass through planes, given by a point and a normal each."""
    start, end = sides.vertices[sides.ends[side]].swapaxes(0, 1)
    low = np.einsum("nd,nd->n", start - points, normals)
    high = np.einsum("nd,nd->n", end - points, normals)
    apart = np.where(low == high, 1.0, low - high)
    return start + np.clip(low / apart, 0, 1)[:, None] * (end - start)
