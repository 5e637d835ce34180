"""Repair of a mesh to a solid: vertices merged, degenerate faces dropped, wound outward, with warnings."""

import logging
from dataclasses import dataclass

import igl
import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.geometry.mesh import edge_uses
from jointsdf.geometry.topology import count_components, signed_volume

COARSE, SLOW = 10, 2_000_000  # numbers of faces at most and at least that are warned of
FLAT = 1e-12  # least side of a solid's box, of its longest side
DEGENERATE = 1e-15  # twice the area of a degenerate face at most, of the longest side squared

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Solid:
    """A repaired mesh, in the frame of the given one.

    Attributes:
        vertices: The positions that a face uses.
        faces: Vertex indices, counter-clockwise seen from outside where there is an outside.
        source_faces: Index of each face among the given ones: repeated and degenerate ones are dropped.
        watertight: Whether each edge has exactly two faces, which agree on the outside.
        flipped: Number of faces whose winding was reversed.
    """

    vertices: Float[ndarray, "v 3"]
    faces: Int[ndarray, "f 3"]
    source_faces: Int[ndarray, " f"]
    watertight: bool
    flipped: int


def repair_mesh(source: str, vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]) -> Solid:
    """Merge vertices by position, drop repeated and degenerate faces, wind outward; warn of defects.

    Args:
        source: Names the mesh in messages.
        vertices: Finite positions.
        faces: Vertex indices, at least one face; their order stays.

    Raises:
        InputError: The mesh has no extent along an axis, or no face with an area.
    """
    once = _find_distinct(source, _first_at_position(vertices)[faces])
    vertices, merged = _merge(vertices, faces[once])
    extents = np.ptp(vertices, axis=0)
    if extents.min() <= FLAT * extents.max():
        raise InputError(f"{source} is flat: its extents are {extents.tolist()}; a solid needs all three above zero")
    proper = _find_proper(source, vertices, merged, extents.max())
    vertices, merged = _merge(vertices, merged[proper])
    wound, watertight = _orient(source, vertices, merged)
    _warn_of_size(source, wound)
    return Solid(vertices, wound, once[proper], watertight, int((wound != merged).any(axis=1).sum()))


def _merge(vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]) -> tuple[ndarray, ndarray]:
    """Merge the vertices that faces use by position; faces and positions keep their order.

    A closed mesh is not merged: where it touches itself, that would open it.
    """
    closed = (edge_uses(faces) == 2).all()
    identity = np.arange(len(vertices)) if closed else _first_at_position(vertices)
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
    """Find the faces that do not repeat an earlier one of the same winding."""
    turned = (np.argmin(faces, axis=1)[:, None] + np.arange(3)) % 3
    faces = np.take_along_axis(faces, turned, axis=1)
    order = np.lexsort(faces.T)
    first = np.ones(len(faces), dtype=bool)
    first[order[1:]] = (faces[order[1:]] != faces[order[:-1]]).any(axis=1)
    if repeated := int((~first).sum()):
        logger.warning("%s: %d repeated faces dropped with their labels", source, repeated)
    return np.flatnonzero(first)


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


def _orient(source: str, vertices: ndarray, faces: ndarray) -> tuple[Int[ndarray, "f 3"], bool]:
    """Wind the faces outward; also whether they close a volume consistently."""
    uses = edge_uses(faces)
    if (uses != 2).any():
        counts = f"{(uses != 2).sum()} of {len(uses)} edges do not have exactly two faces"
        logger.warning("%s: not watertight (%s): the sign comes from the winding number", source, counts)
        return faces, False
    if not _is_consistent(faces):
        faces, disagreeing = _flip_minorities(faces)
        if not _is_consistent(faces):
            logger.warning("%s: has no outside (one-sided surface): the sign comes from the winding number", source)
            return faces, False
        logger.warning("%s: %d faces were inside out and are flipped to agree with the rest", source, disagreeing)
    if signed_volume(vertices, faces) < 0:
        logger.warning("%s: inside out (negative volume): all faces flipped", source)
        faces = faces[:, ::-1].copy()
    return faces, True


def _is_consistent(faces: Int[ndarray, "f 3"]) -> bool:
    """True if no edge is traversed twice in one direction, as between faces that disagree about the outside."""
    ends = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    return len(np.unique(ends[:, 0] * (int(faces.max()) + 1) + ends[:, 1])) == len(ends)


def _flip_minorities(faces: Int[ndarray, "f 3"]) -> tuple[Int[ndarray, "f 3"], int]:
    """Flip faces that disagree with most of their component; also the number of them."""
    oriented, component = igl.bfs_orient(faces)
    flipped = (oriented != faces).any(axis=1)
    mostly_flipped = np.bincount(component, flipped) > 0.5 * np.bincount(component)
    flipped ^= mostly_flipped[component]
    return np.where(flipped[:, None], faces[:, ::-1], faces), int(flipped.sum())


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
