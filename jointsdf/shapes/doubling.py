"""Faces that are there twice, with opposite windings: two-sided export of one surface, or bodies that touch."""

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from jointsdf.geometry.mesh import edge_keys
from jointsdf.geometry.topology import components, edge_components
from jointsdf.geometry.winding import INSIDE, WindingNumber


def find_twins(faces: Int[ndarray, "f 3"]) -> Int[ndarray, " f"]:
    """Find for each face the one of the same corners and the opposite winding, -1 where there is none.

    Args:
        faces: Vertices merged by position, no face repeated with the same winding, none degenerate.
    """
    order = np.lexsort(np.sort(faces, axis=1).T)
    ordered = np.sort(faces, axis=1)[order]
    same = np.flatnonzero((ordered[1:] == ordered[:-1]).all(axis=1))
    twins = np.full(len(faces), -1)
    twins[order[same]], twins[order[same + 1]] = order[same + 1], order[same]
    return twins


def find_doubled(vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]) -> Bool[ndarray, " f"]:
    """Find the second faces of twins that are one surface exported with both sides.

    Twins are such where all faces that they are connected with are twins, or where most edges at the rim of a patch of
    them have an even number of faces once the second ones are gone. Bodies that touch have an odd number there, and a
    body that fills a cavity is enclosed by the rest of the mesh: both keep all faces.

    Args:
        vertices: Positions.
        faces: As of `find_twins`.
    """
    twins = find_twins(faces)
    second = (twins >= 0) & (twins < np.arange(len(faces)))
    if not second.any():
        return second
    whole = edge_components(faces)
    alone = np.bincount(whole, twins < 0) == 0
    entirely = alone[whole]
    if not entirely.all():
        rest = faces[twins < 0]
        if len(rest):
            entirely &= ~_enclosed(vertices, faces, whole, entirely, WindingNumber(vertices, rest))
    return second & (entirely | (~alone[whole] & _close_their_rim(faces, second)))


def _enclosed(
    vertices: ndarray, faces: ndarray, whole: ndarray, of: Bool[ndarray, " f"], rest: WindingNumber
) -> Bool[ndarray, " f"]:
    """Whether the component of each face is within what the rest encloses, whatever its winding."""
    asked = np.flatnonzero(of)
    within = np.zeros(len(faces))
    within[asked] = np.abs(rest.at(vertices[faces[asked]].mean(axis=1))) > INSIDE
    return (np.bincount(whole, within) > INSIDE * np.bincount(whole))[whole]


def _close_their_rim(faces: Int[ndarray, "f 3"], second: Bool[ndarray, " f"]) -> Bool[ndarray, " f"]:
    """Whether the edges around each patch of second faces have an even number of faces without them, most of them."""
    count = int(faces.max()) + 1
    _, edge, uses = np.unique(edge_keys(faces, count), return_inverse=True, return_counts=True)
    edge = edge.reshape(-1, 3)[second]
    number = len(edge)
    nodes = np.stack([np.repeat(np.arange(number), 3), number + edge.ravel()], axis=1)
    patch = components(nodes, number + len(uses))[:number]
    gone, times = np.unique(np.stack([np.repeat(patch, 3), edge.ravel()], axis=1), axis=0, return_counts=True)
    rim = times % 2 == 1
    votes = np.where((uses[gone[rim, 1]] - times[rim]) % 2 == 0, 1, -1)
    closing = np.bincount(gone[rim, 0], votes, minlength=int(patch.max()) + 1) > 0
    found = np.zeros(len(faces), dtype=bool)
    found[second] = closing[patch]
    return found
