"""Pieces of a surface that are left out because they are small."""

import logging

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.geometry.mesh import used_vertices
from jointsdf.geometry.topology import component_sizes, face_components

log = logging.getLogger(__name__)


def drop_small_pieces(
    vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], share: int | float
) -> tuple[Float[ndarray, "w 3"], Int[ndarray, "g 3"]]:
    """Leave out the connected components whose bounding box is smaller than a share of the whole surface's.

    The largest stay, whatever the share.

    Args:
        vertices: Positions.
        faces: Vertex indices; faces that share a vertex are connected.
        share: Longest side of a piece's bounding box by that of the surface; 0 keeps all.

    Returns:
        Vertices and faces, in their order.
    """
    if share == 0 or not len(faces):
        return vertices, faces
    piece = face_components(faces)
    sizes = component_sizes(vertices, faces, piece)
    small = sizes < min(share * np.ptp(vertices[np.unique(faces)], axis=0).max(), sizes.max())
    if not small.any():
        return vertices, faces
    log.info("extraction: %d of %d pieces left out, smaller than %g of the length", small.sum(), len(small), share)
    used, kept = used_vertices(faces[~small[piece]], len(vertices))
    return vertices[used], kept
