"""Faces cut where creases run across them, as `face_labels.py` cuts them at part borders."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from jointsdf.extraction.crease_band import Band
from jointsdf.extraction.crease_lines import Crossings
from jointsdf.extraction.crease_snaps import corner_points, snap_to_corners, snap_to_creases
from jointsdf.geometry.mesh import edge_keys

CLEAR = 0.02  # least distance of the vertices beside a crease from it, cells
SLIDE = 0.5  # longest way that they are moved for it, cells
NEAREST_CUT = 1 / 64  # of an edge: least distance of a cut from its ends, before the cut moves onto the crease


@dataclass(frozen=True)
class CutBand:
    """A band whose faces are cut along creases.

    Attributes:
        faces: Vertices, as indices into those of the band, then the cuts of edges, then the corners within faces.
        owners: Vertex of the band on whose side each face is.
        before: Where each vertex is if nothing is made sharp: on the surface of marching cubes.
        after: Where it belongs.
        on_crease: Marks the vertices on creases and corners.
        along: Unit vector along the crease of each of these; 0 at corners and elsewhere.
    """

    faces: Int[ndarray, "g 3"]
    owners: Int[ndarray, " g"]
    before: Float[ndarray, "w 3"]
    after: Float[ndarray, "w 3"]
    on_crease: Bool[ndarray, " w"]
    along: Float[ndarray, "w 3"]


def cut_band(
    band: Band, crossings: Crossings, original: Float[ndarray, "b 3"], points: Float[ndarray, "b 3"], cell: float
) -> CutBand:
    """Cut the faces of a band along its creases.

    A crease crosses the edge between a and b where the straight line between them does once the two planes are laid
    flat, so that cuts follow each other in the order of their edges. A face that it crosses becomes three, and one
    with three sides six about their corner. At a vertex that is on the crease itself no edge is cut.

    Args:
        band: With the planes of the sides.
        crossings: Edges that creases run across.
        original: Places of the band's vertices in the mesh.
        points: Places on the planes of their sides.
        cell: Edge of a cell of the grid.
    """
    count, ends = len(points), crossings.ends
    number, crossed = _crossings_of_sides(band.corners, ends, count)
    bound, fixed, points = _bind(band, crossings, points, band.corners[crossed.all(axis=1)], cell)
    shares, places = _cuts(crossings, points, cell)
    crossed &= ~(bound[band.corners] | np.roll(bound[band.corners], -1, axis=1))
    three = np.flatnonzero(crossed.all(axis=1))
    centres = corner_points(band, band.corners[three], places[number[three]].mean(axis=1), cell)
    after = np.concatenate([points, places, centres])
    cuts = np.where(crossed, count + number, -1)
    faces, owners = _split(band.corners, cuts, bound[band.corners], count + len(places), after)
    shares = np.clip(shares, NEAREST_CUT, 1 - NEAREST_CUT)[:, None]
    chopped = (1 - shares) * original[ends[:, 0]] + shares * original[ends[:, 1]]
    along = np.zeros_like(after)
    along[ends] = crossings.directions[:, None]
    along[:count][~bound | fixed] = 0
    along[count : count + len(places)] = crossings.directions
    on_crease = np.concatenate([bound, np.ones(len(places) + len(centres), dtype=bool)])
    before = np.concatenate([original, chopped, original[band.corners[three]].mean(axis=1)])
    return CutBand(faces, owners, before, after, on_crease, along)


def _crossings_of_sides(
    corners: Int[ndarray, "f 3"], ends: Int[ndarray, "e 2"], count: int
) -> tuple[Int[ndarray, "f 3"], Bool[ndarray, "f 3"]]:
    """The crossing that each side of the faces is, and whether it is one."""
    keys, sides = ends @ [count, 1], edge_keys(corners, count)
    place = np.minimum(np.searchsorted(keys, sides), len(keys) - 1)
    return place.reshape(-1, 3), (keys[place] == sides).reshape(-1, 3)


def _bind(
    band: Band, crossings: Crossings, points: Float[ndarray, "b 3"], corners: Int[ndarray, "c 3"], cell: float
) -> tuple[Bool[ndarray, " b"], Bool[ndarray, " b"], Float[ndarray, "b 3"]]:
    """Move the vertices close to creases onto them, and the others clear of them.

    Returns:
        Vertices on creases, those of them on corners, and all places.
    """
    at_corner = np.zeros(len(points), dtype=bool)
    at_corner[corners] = True
    bound, on_crease = snap_to_creases(band, crossings, points, at_corner, cell)
    fixed, on_corner = snap_to_corners(band, corners, points, cell)
    places = np.where(bound[:, None], on_crease, np.where(fixed[:, None], on_corner, points))
    bound |= fixed
    own = crossings.ends.ravel()
    lacking = np.clip(CLEAR * cell - crossings.depths(places).ravel(), 0, SLIDE * cell)
    order = np.argsort(lacking, kind="stable")
    slide = np.zeros_like(places)
    slide[own[order]] = (lacking[:, None] * crossings.inward.reshape(-1, 3))[order]
    return bound, fixed, np.where(bound[:, None], places, places + slide)


def _cuts(
    crossings: Crossings, points: Float[ndarray, "b 3"], cell: float
) -> tuple[Float[ndarray, " e"], Float[ndarray, "e 3"]]:
    """Share of the way along each edge, once its planes are laid flat, and the place on the crease."""
    depths = np.maximum(crossings.depths(points), CLEAR * cell / 2)
    shares = depths[:, 0] / depths.sum(axis=1)
    first, second = points[crossings.ends].swapaxes(0, 1)
    way = (1 - shares)[:, None] * first + shares[:, None] * second - crossings.origins
    along = np.einsum("ed,ed->e", way, crossings.directions)
    return shares, crossings.origins + along[:, None] * crossings.directions


def _split(
    corners: Int[ndarray, "f 3"],
    cuts: Int[ndarray, "f 3"],
    bound: Bool[ndarray, "f 3"],
    first_centre: int,
    places: Float[ndarray, "w 3"],
) -> tuple[Int[ndarray, "g 3"], Int[ndarray, " g"]]:
    """Cut the faces, and tell a vertex on whose side each piece is."""
    crossed = cuts >= 0
    whole, one, two, three = (np.flatnonzero(crossed.sum(axis=1) == number) for number in range(4))
    pieces = [(corners[whole], corners[whole, np.argmax(~bound[whole], axis=1)])]
    turn = (np.argmax(crossed[one], axis=1)[:, None] + np.arange(3)) % 3  # the cut edge first, same winding
    (a, b, c), cut = np.take_along_axis(corners[one], turn, 1).T, np.take_along_axis(cuts[one], turn, 1)[:, 0]
    pieces += [(np.stack([a, cut, c], axis=1), a), (np.stack([cut, b, c], axis=1), b)]
    turn = (np.argmax(~crossed[two], axis=1)[:, None] + np.array([2, 0, 1])) % 3  # the corner cut off first
    (a, b, c), (ab, _, ca) = np.take_along_axis(corners[two], turn, 1).T, np.take_along_axis(cuts[two], turn, 1).T
    longer = np.linalg.norm(places[b] - places[ca], axis=1) > np.linalg.norm(places[c] - places[ab], axis=1)
    third, first = np.where(longer, c, ca), np.where(longer, ab, b)  # the shorter diagonal: c to ab, or b to ca
    pieces.append((np.stack([a, ab, ca], axis=1), a))
    pieces.append((np.stack([ab, b, third], axis=1), b))
    pieces.append((np.stack([first, c, ca], axis=1), c))
    centre = first_centre + np.arange(len(three))
    for i in range(3):
        own = corners[three, i]
        pieces.append((np.stack([own, cuts[three, i], centre], axis=1), own))
        pieces.append((np.stack([cuts[three, i - 1], own, centre], axis=1), own))
    faces, owners = (np.concatenate(column) for column in zip(*pieces, strict=True))
    return faces, owners
