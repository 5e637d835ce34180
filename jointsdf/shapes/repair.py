"""Repair of a mesh to a solid: vertices merged, needless faces dropped, wound outward, with warnings."""

import logging
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.geometry.topology import count_components, is_closed
from jointsdf.shapes.doubling import find_doubled, find_repeated
from jointsdf.shapes.orientation import orient
from jointsdf.shapes.overlaps import examine_sides, is_folded
from jointsdf.shapes.welding import weld

COARSE, SLOW = 10, 2_000_000  # numbers of faces at most and at least that are warned of
FLAT = 1e-12  # least side of a solid's box, of its longest side
ENCLOSING = 0.02  # share of the surface that must have inside just beneath it; a tray 2% deep has 11%, sheets have 0
DEGENERATE = 1e-15  # twice the area of a degenerate face at most, of the longest side squared

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Solid:
    """A repaired mesh, in the frame of the given one.

    Attributes:
        vertices: The positions that a face uses.
        faces: Vertex indices, counter-clockwise seen from outside where there is an outside.
        source_faces: Index of each face among the given ones: repeated, doubled and degenerate ones are dropped.
        watertight: Whether each edge has exactly two faces, which agree on the outside.
        folded: Whether they do, but overlap or fold over.
        flipped: Number of faces whose winding was reversed.
        welded: Number of vertices that were moved to another one, nearly at the same place.
    """

    vertices: Float[ndarray, "v 3"]
    faces: Int[ndarray, "f 3"]
    source_faces: Int[ndarray, " f"]
    watertight: bool
    folded: bool
    flipped: int
    welded: int


def repair_mesh(source: str, vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]) -> Solid:
    """Merge vertices by position or weld them, drop needless faces, wind outward; warn of defects.

    Args:
        source: Names the mesh in messages.
        vertices: Finite positions.
        faces: Vertex indices, at least one face; their order stays.

    Raises:
        InputError: The mesh has no extent along an axis, no face with an area, or encloses nothing.
    """
    vertices, clean, kept = _clean(source, vertices, faces)
    snapped = weld(source, vertices, clean)
    welded = 0
    if snapped is not None:
        welded = int((snapped != vertices).any(axis=1).sum())
        vertices, clean, again = _clean(source, snapped, clean)
        kept = kept[again]
    wound, watertight = orient(source, vertices, clean)
    folded = _check_sides(source, vertices, wound, watertight)
    _warn_of_size(source, wound)
    return Solid(vertices, wound, kept, watertight, folded, int((wound != clean).any(axis=1).sum()), welded)


def _clean(source: str, vertices: ndarray, faces: ndarray) -> tuple[ndarray, ndarray, Int[ndarray, " k"]]:
    """Merge vertices by position and drop repeated, degenerate and doubled faces; also the kept ones' indices."""
    once = _find_distinct(source, _first_at_position(vertices)[faces])
    vertices, merged = _merge(vertices, faces[once])
    extents = np.ptp(vertices, axis=0)
    if extents.min() <= FLAT * extents.max():
        raise InputError(f"{source} is flat: its extents are {extents.tolist()}; a solid needs all three above zero")
    kept = _find_proper(source, vertices, merged, extents.max())
    doubled = find_doubled(vertices, _first_at_position(vertices)[merged[kept]])
    if doubled.any():
        logger.warning("%s: %d faces are doubled with the opposite winding: dropped", source, doubled.sum())
        kept = kept[~doubled]
    vertices, merged = _merge(vertices, merged[kept])
    return vertices, merged, once[kept]


def _check_sides(source: str, vertices: ndarray, faces: ndarray, watertight: bool) -> bool:
    """Refuse a mesh that encloses almost nothing; say whether closed faces overlap or fold over."""
    a, b, c = vertices[faces.T]
    sides = examine_sides(vertices, faces, np.linalg.norm(np.cross(b - a, c - a), axis=1))
    if sides.enclosing < ENCLOSING:
        raise InputError(
            f"{source} encloses almost nothing ({sides.enclosing:.0%} of its faces have an inside): a solid is needed, "
            "so give open sheets a thickness or close them in the CAD program"
        )
    folded = watertight and is_folded(vertices, faces, sides)
    if folded:
        logger.warning("%s: closed faces overlap or touch: the sign comes from the winding number", source)
    return folded


def _merge(vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]) -> tuple[ndarray, ndarray]:
    """Merge the vertices that faces use by position; faces and positions keep their order.

    A closed mesh is not merged: where it touches itself, that would open it.
    """
    identity = np.arange(len(vertices)) if is_closed(faces) else _first_at_position(vertices)
    used, merged = np.unique(identity[faces], return_inverse=True)
    return vertices[used], merged.reshape(faces.shape)


def _first_at_position(vertices: Float[ndarray, "v 3"]) -> Int[ndarray, " v"]:
    """Find for each vertex the first one at its position."""
    order = np.lexsort(vertices.T)
    starts = np.ones(len(order), dtype=bool)
    starts[1:] = (vertices[order[1:]] != vertices[order[:-1]]).any(axis=1)
    identity = np.zeros(len(vertices), dtype=np.int64)
    identity[order] = order[starts][np.cumsum(starts) - 1]
    return identity


def _find_distinct(source: str, faces: Int[ndarray, "f 3"]) -> Int[ndarray, " k"]:
    """Find the faces that are not repeated."""
    repeated = find_repeated(faces)
    if repeated.any():
        logger.warning("%s: %d repeated faces dropped with their labels", source, repeated.sum())
    return np.flatnonzero(~repeated)


def _find_proper(source: str, vertices: ndarray, faces: ndarray, size: float) -> Int[ndarray, " k"]:
    """Find the faces that have an area."""
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    doubled_area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    proper = np.flatnonzero(doubled_area > DEGENERATE * size**2)
    if len(proper) == 0:
        raise InputError(f"{source} has no faces with an area: all {len(faces)} are degenerate")
    if len(proper) < len(faces):
        logger.warning("%s: %d degenerate faces (no area) dropped with their labels", source, len(faces) - len(proper))
    return proper


def _warn_of_size(source: str, faces: ndarray) -> None:
    """Warn of several components, very few and very many faces."""
    components = count_components(faces)
    if components > 1:
        logger.warning(
            "%s: %d separate components: one field describes them all, and small ones may be lost", source, components
        )
    if len(faces) <= COARSE:
        logger.warning("%s: very coarse (%d faces): the field will round it off", source, len(faces))
    if len(faces) >= SLOW:
        logger.warning(
            "%s: %d faces: distances and measures will be slow; a mesh below %d is enough", source, len(faces), SLOW
        )
