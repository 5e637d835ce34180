"""Surfaces for the screen: fewer faces at a distance that is measured, and none so long that errors within it hide."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.extraction.flat_regions import collapse_edges, merge_flat_regions
from jointsdf.geometry.creases import REACH, find_creases
from jointsdf.geometry.distance import ClosestPoint, split_long_faces
from jointsdf.geometry.mesh import border_edges, edge_keys, used_vertices
from jointsdf.values import LabelledMesh

FIRST = 2e-4  # of the longest side: tolerance of the first merging; the library moves the surface by some of them
GROWTH, MERGINGS = 2.0, 5  # of the tolerance from one merging to the next; their number
FINEST, SHORTENING = 1 / 40, 0.7  # longest edge that is still halved, of the longest side; from one round to the next
SPLIT = 1.3  # faces after the halving, of those asked for
PROBES = 10_000  # points of each surface whose distance from the other is measured, at most


@dataclass(frozen=True)
class Display:
    """A surface as it is shown.

    Attributes:
        mesh: File frame, labelled as the full one.
        moved: Largest distance found between it and the full surface, file units; 0 for the full one.
        longest: Edge of its faces, file units: so far apart are the places at which errors are known.
        full_faces: Faces of the full surface.
        lines: Vertices at the ends of creases and part borders, once for each part at them.
        line_parts: Part of each line.
    """

    mesh: LabelledMesh
    moved: float
    longest: float
    full_faces: int
    lines: Int[ndarray, "l 2"]
    line_parts: Int[ndarray, " l"]


def display(mesh: LabelledMesh, most_faces: int, full: ClosestPoint | None = None) -> Display:
    """Merge faces of nearly flat regions until there are few, then halve the long ones.

    The distance is measured from vertices of the full surface, and back from middles of the faces shown.

    Args:
        mesh: File frame, not empty.
        most_faces: Number to which faces are merged, as far as tolerances allow.
        full: The mesh's closest point, if it is known already.
    """
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    size = float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    shown = mesh
    for merging in range(MERGINGS):
        if len(shown.faces) <= most_faces:
            break
        merged = _merge(shown, FIRST * GROWTH**merging * size)
        if merged is None or merged.is_empty:
            break
        shown = merged
    moved = 0.0 if shown is mesh else _distance(mesh, full or ClosestPoint(mesh), shown)
    pieces, face, longest = _split(shown.vertices[shown.faces].astype(np.float64), size, int(SPLIT * most_faces))
    lines, parts = _lines(shown, REACH * size)
    rows = np.concatenate([pieces.reshape(-1, 3), shown.vertices[lines].reshape(-1, 3)])
    vertices, number = _numbered(rows)
    faces, ends = np.split(number, [pieces.size // 3])
    split = LabelledMesh(vertices, faces.reshape(-1, 3), shown.labels[face])
    return Display(split, moved, longest, len(mesh.faces), ends.reshape(-1, 2), parts)


def _split(
    corners: Float[ndarray, "f 3 3"], size: float, most: int
) -> tuple[Float[ndarray, "p 3 3"], Int[ndarray, " p"], float]:
    """Halve the longest edges first, as long as the faces are not too many.

    Returns:
        The pieces, the face of each, in their order, and the longest edge.
    """
    face, longest = np.arange(len(corners)), size
    while longest > FINEST * size:
        longest *= SHORTENING
        pieces, of = split_long_faces(corners, longest)
        if len(pieces) > most:
            break
        order = np.argsort(face[of], kind="stable")
        corners, face = pieces[order], face[of][order]
    return corners, face, float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max())


def _numbered(rows: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, "v 3"], Int[ndarray, " n"]]:
    """The different rows in the order of their first use, and the number of each: neighbours are near, for gzip."""
    _, first, number = np.unique(rows.view("V24").reshape(-1), return_index=True, return_inverse=True)
    order = np.argsort(first)
    places = np.zeros(len(order), dtype=np.int64)
    places[order] = np.arange(len(order))
    return rows[first[order]], places[number]


def _distance(mesh: LabelledMesh, full: ClosestPoint, shown: LabelledMesh) -> float:
    vertices = mesh.vertices[np.unique(mesh.faces)].astype(np.float64)
    there = ClosestPoint(shown).query(vertices[:: -(-len(vertices) // PROBES)])[0]
    middles = shown.vertices[shown.faces[:: -(-len(shown.faces) // PROBES)]].mean(axis=1)
    back = full.query(middles)[0]
    return float(max(there.max(), back.max()))


def _lines(mesh: LabelledMesh, reach: float) -> tuple[Int[ndarray, "l 2"], Int[ndarray, " l"]]:
    """Edges that are creases or borders between parts, once for each part at them."""
    faces, count = mesh.faces.astype(np.int64), len(mesh.vertices)
    wanted = np.concatenate([find_creases(mesh, reach).edges, border_edges(mesh)]) @ np.array([count, 1])
    keys, labels = edge_keys(faces, count), np.repeat(mesh.labels, 3)
    here = np.isin(keys, wanted)
    found = np.unique(np.stack([keys[here], labels[here]], axis=1), axis=0)
    return np.stack(np.divmod(found[:, 0], count), axis=1), found[:, 1]


def _merge(mesh: LabelledMesh, tolerance: float) -> LabelledMesh | None:
    """A closed mesh is merged by the library alone, which is fast; another one piece by piece."""
    kinds, kind = np.unique(mesh.labels, return_inverse=True)
    used, faces = used_vertices(mesh.faces, len(mesh.vertices))
    found = collapse_edges(mesh.vertices[used].astype(np.float64), faces, kind, [tolerance])
    if found is not None:
        return LabelledMesh(found[0], found[1], kinds[found[2]])
    return merge_flat_regions(mesh, [tolerance], np.zeros(len(mesh.faces), dtype=bool))
