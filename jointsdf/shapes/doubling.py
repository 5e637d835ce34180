"""Faces that are there twice: repeated, both sides of one surface, or the walls of bodies that touch."""

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from jointsdf.geometry.mesh import edge_keys
from jointsdf.geometry.topology import components, edge_components
from jointsdf.geometry.winding import INSIDE, WindingNumber


def find_repeated(faces: Int[ndarray, "f 3"]) -> Bool[ndarray, " f"]:
    """Find the faces that repeat an earlier one of the same winding, but for walls of bodies that touch.

    Without one of two walls, most edges at its rim would have three faces.

    Args:
        faces: Vertices merged by position.
    """
    first = (np.argmin(faces, axis=1)[:, None] + np.arange(3)) % 3
    canonical = np.take_along_axis(faces, first, axis=1)
    order = np.lexsort(canonical.T)
    repeated = np.zeros(len(faces), dtype=bool)
    repeated[order[1:]] = (canonical[order[1:]] == canonical[order[:-1]]).all(axis=1)
    if repeated.any():
        repeated[repeated] = _vote_at_rim(faces, repeated, single=1) >= 0
    return repeated


def find_twins(faces: Int[ndarray, "f 3"]) -> Int[ndarray, " f"]:
    """Find for each face another one of the same corners, -1 where there is none.

    Args:
        faces: Vertices merged by position, none degenerate.
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
    second[second] = entirely[second] | (~alone[whole][second] & (_vote_at_rim(faces, second, single=-1) > 0))
    return second


def _enclosed(
    vertices: ndarray, faces: ndarray, whole: ndarray, of: Bool[ndarray, " f"], rest: WindingNumber
) -> Bool[ndarray, " f"]:
    """Whether the component of each face is within what the rest encloses, whatever its winding."""
    asked = np.flatnonzero(of)
    within = np.zeros(len(faces))
    within[asked] = np.abs(rest.at(vertices[faces[asked]].mean(axis=1))) > INSIDE
    return (np.bincount(whole, within) > INSIDE * np.bincount(whole))[whole]


def _vote_at_rim(faces: Int[ndarray, "f 3"], gone: Bool[ndarray, " f"], *, single: int) -> Int[ndarray, " g"]:
    """Sum for each gone face the votes of the edges at the rim of its patch: 1 where an even number of faces remains.

    Args:
        faces: Vertex indices.
        gone: Faces to be left out, at least one.
        single: Vote of an edge where one face remains; it is -1 where three do, or another odd number.
    """
    count = int(faces.max()) + 1
    _, edge, uses = np.unique(edge_keys(faces, count), return_inverse=True, return_counts=True)
    edge = edge.reshape(-1, 3)[gone]
    number = len(edge)
    nodes = np.stack([np.repeat(np.arange(number), 3), number + edge.ravel()], axis=1)
    patch = components(nodes, number + len(uses))[:number]
    at_edge, times = np.unique(np.stack([np.repeat(patch, 3), edge.ravel()], axis=1), axis=0, return_counts=True)
    rim = times % 2 == 1
    left = uses[at_edge[rim, 1]] - times[rim]
    votes = np.where(left == 1, single, np.where(left % 2 == 0, 1, -1))
    found = np.bincount(at_edge[rim, 0], votes, minlength=int(patch.max()) + 1)
    return found[patch].astype(np.int64)
