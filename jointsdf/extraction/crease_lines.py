"""The creases near a mesh as lines: where the planes of the two sides meet, at each edge that has one end on each.

What looks like a crease may be a rounding (`crease_probes.py`). There vertices go back to the tangent planes of their
own, and creases are looked for once more: the face of a narrow chamfer has one on either side.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from jointsdf.extraction.crease_band import Band
from jointsdf.geometry.mesh import unit

ANGLE = np.radians(25.0)  # between the planes of two neighbours from which a crease may run between them
AWAY = 1.5  # farthest of the line from the edge, cells
RINGS = 2  # of vertices beside the crossings that are on the planes of their sides


@dataclass(frozen=True)
class Crossings:
    """Edges of a band that creases run across.

    Attributes:
        ends: The two vertices of each, as indices into the band's, the lower first, in ascending order.
        origins: A point of the crease beside the middle of the edge.
        directions: Unit vector along the crease.
        inward: Unit vectors in the planes of both sides, away from the crease and into the side.
    """

    ends: Int[ndarray, "e 2"]
    origins: Float[ndarray, "e 3"]
    directions: Float[ndarray, "e 3"]
    inward: Float[ndarray, "e 2 3"]

    def rows(self, chosen: Bool[ndarray, " e"] | Int[ndarray, " k"]) -> "Crossings":
        """Some of them."""
        return Crossings(self.ends[chosen], self.origins[chosen], self.directions[chosen], self.inward[chosen])

    def depths(self, points: Float[ndarray, "b 3"]) -> Float[ndarray, "e 2"]:
        """Distance of the ends from the crease within their planes, positive on their own side.

        Args:
            points: Of the band's vertices.
        """
        return np.einsum("esd,esd->es", points[self.ends] - self.origins[:, None], self.inward)


def meeting_lines(band: Band, ends: Int[ndarray, "e 2"]) -> Crossings:
    """Lines in which the planes of the two ends of edges meet."""
    (one, other), (first, second) = band.normals[ends].swapaxes(0, 1), band.anchors[ends].swapaxes(0, 1)
    middle, apart = band.points[ends].mean(axis=1), first - second
    cosine = np.einsum("ed,ed->e", one, other)
    sine2 = np.maximum(1 - cosine**2, 1e-3)
    to_one = np.einsum("ed,ed->e", first - middle, one)
    to_other = np.einsum("ed,ed->e", second - middle, other)
    origins = middle + ((to_one - cosine * to_other) / sine2)[:, None] * one
    origins += ((to_other - cosine * to_one) / sine2)[:, None] * other
    valley = np.einsum("ed,ed->e", apart, other) > np.einsum("ed,ed->e", apart, one)
    sign = np.where(valley, 1.0, -1.0)[:, None]
    inward = [sign * unit(b - cosine[:, None] * a) for a, b in ((one, other), (other, one))]
    return Crossings(ends, origins, unit(np.cross(one, other)), np.stack(inward, axis=1))


def candidates(band: Band, tested: Bool[ndarray, " e"], cell: float) -> tuple[Int[ndarray, " k"], Crossings]:
    """Edges of a band across which a crease may run.

    Args:
        band: With the planes.
        tested: Marks the edges to look at.
        cell: Edge of a cell of the grid.

    Returns:
        Their numbers and their lines.
    """
    one, other = band.normals[band.edges].swapaxes(0, 1)
    bent = np.einsum("ed,ed->e", one, other) < np.cos(ANGLE)
    rows = np.flatnonzero(tested & bent & ~band.rim[band.edges].any(axis=1))
    found = meeting_lines(band, band.edges[rows])
    near = np.linalg.norm(found.origins - band.points[found.ends].mean(axis=1), axis=1) < AWAY * cell
    return rows[near], found.rows(near)


def beside(band: Band, crossings: Crossings) -> Bool[ndarray, " b"]:
    """Mark the vertices on either side of creases, as far as their planes are those of the sides."""
    reached = np.zeros(len(band.points), dtype=bool)
    reached[crossings.ends] = True
    one, other = band.normals[band.edges].swapaxes(0, 1)
    pairs = band.edges[np.einsum("ed,ed->e", one, other) > np.cos(ANGLE)]
    for _ in range(RINGS):
        reached[pairs[reached[pairs].any(axis=1)]] = True
    return reached
