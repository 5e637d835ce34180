"""Merging of faces in nearly flat regions, by manifold3d's edge collapses (Lalish, github.com/elalish/manifold)."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int
from manifold3d import Error, Manifold, Mesh64
from numpy import ndarray

from jointsdf.geometry.mesh import edge_keys, face_normals
from jointsdf.geometry.topology import edge_components
from jointsdf.values import LabelledMesh

APART = 1e-9  # between vertices at one place, of the coordinates' range
AWAY = np.array([3.0, 5.0, 7.0])  # of an inner side from the surface, of that range


def merge_flat_regions(
    mesh: LabelledMesh, tolerances: Sequence[float], fixed: Bool[ndarray, " f"]
) -> LabelledMesh | None:
    """Collapse edges within nearly flat regions, and along the nearly straight lines between them.

    A region is of one label, so a border between parts is the line of both of them. Every new vertex is one of the
    given ones. The library takes closed meshes only, and decides which edges it flips, so faces to be kept are replaced
    by cones for the time; a piece of the surface with a rim, or with edges of more than two faces, is closed by its own
    inner side. Every such face is a region of its own, so that what it adjoins stays.

    Args:
        mesh: The surface; no face without area.
        tolerances: Of the library, one after another, mesh units. It moves the surface by up to twice as much.
        fixed: Faces to keep as they are.

    Returns:
        The surface, with the given mesh's vertices; None where the library refuses it.
    """
    faces = mesh.faces[~fixed].astype(np.int64)
    places, cones = _cones(mesh.vertices.astype(np.float64), mesh.faces[fixed].astype(np.int64), faces)
    parts, kind = np.unique(mesh.labels[~fixed], return_inverse=True)
    closed = np.concatenate([faces, cones])
    closed = np.concatenate([closed, _inner_side(closed, len(places))])
    kinds = np.concatenate([kind, len(parts) + np.arange(len(closed) - len(faces))])
    found = _collapse(_distinct(places), closed, kinds, tolerances)
    if found is None:
        return None
    outer = found[1] < len(parts)
    labels = np.concatenate([parts[found[1][outer]], mesh.labels[fixed]])
    return LabelledMesh(mesh.vertices, np.concatenate([found[0][outer], mesh.faces[fixed]]), labels)


def _cones(
    vertices: Float[ndarray, "v 3"], fixed: Int[ndarray, "k 3"], others: Int[ndarray, "f 3"]
) -> tuple[Float[ndarray, "w 3"], Int[ndarray, "c 3"]]:
    """A cone over the rim of each connected piece of the fixed faces; the vertices with the apices behind them."""
    if not len(fixed):
        return vertices, fixed
    piece = np.repeat(edge_components(fixed), 3)
    normals = np.zeros((int(piece.max()) + 1, 3))
    np.add.at(normals, piece[::3], face_normals(vertices, fixed))
    starts, ends = fixed.reshape(-1), np.roll(fixed, -1, axis=1).reshape(-1)
    rim = np.isin(edge_keys(fixed, len(vertices)), edge_keys(others, len(vertices)))
    starts, ends, piece = starts[rim], ends[rim], piece[rim]
    count = np.maximum(np.bincount(piece, minlength=len(normals)), 1)[:, None]
    middles, lengths = np.zeros_like(normals), np.linalg.norm(vertices[ends] - vertices[starts], axis=1)
    np.add.at(middles, piece, vertices[starts])
    height = np.bincount(piece, lengths, minlength=len(normals))[:, None] / 4
    steepness = np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
    apices = middles / count + height * normals / steepness
    return np.concatenate([vertices, apices]), np.stack([starts, ends, len(vertices) + piece], axis=1)


def _inner_side(faces: Int[ndarray, "f 3"], count: int) -> Int[ndarray, "g 3"]:
    """The inner side of every piece that is not closed, joined to it where it is not; its other vertices are new."""
    loose = _loose_sides(faces, count)
    piece = edge_components(faces)
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)[loose]
    inner = np.where(np.isin(np.arange(count), ends), np.arange(count), count + np.arange(count))
    doubled: Int[ndarray, "g 3"] = inner[faces[np.isin(piece, piece[loose.reshape(-1, 3).any(axis=1)])]][:, ::-1]
    return doubled


def _distinct(vertices: Float[ndarray, "v 3"]) -> Float[ndarray, "w 3"]:
    """The vertices, and again those of an inner side, no two at one place: by that the library's are found again."""
    span = np.ptp(vertices)
    twice = np.concatenate([vertices, vertices + AWAY * span])  # a fold would count as flat
    order = np.lexsort(twice.T)
    same = np.append(False, (np.diff(twice[order], axis=0) == 0).all(axis=1))
    place = np.arange(len(order))
    twice[order, 0] += (place - np.maximum.accumulate(np.where(same, 0, place))) * APART * span
    return twice


def _collapse(
    places: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], kinds: Int[ndarray, " f"], tolerances: Sequence[float]
) -> tuple[Int[ndarray, "g 3"], Int[ndarray, " g"]] | None:
    """Simplify by the library, which keeps edges between faces of two kinds; the vertices are the given ones."""
    used, corners = np.unique(faces, return_inverse=True)
    merged = collapse_edges(places[used], corners.reshape(-1, 3), kinds, tolerances)
    if merged is None:
        return None
    both = np.concatenate([places[used], merged[0]])
    _, first, number = np.unique(both, axis=0, return_index=True, return_inverse=True)
    origin = first[number.reshape(-1)[len(used) :]]
    if (origin >= len(used)).any():
        return None
    return used[origin[merged[1]]], merged[2]


def collapse_edges(
    vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], kinds: Int[ndarray, " f"], tolerances: Sequence[float]
) -> tuple[Float[ndarray, "w 3"], Int[ndarray, "g 3"], Int[ndarray, " g"]] | None:
    """Simplify a closed mesh by the library alone, which keeps edges between faces of two kinds.

    Args:
        vertices: Mesh units; those of the result are some of them.
        faces: Every edge has two of them.
        kinds: Of the faces, at least 0.
        tolerances: As for `merge_flat_regions`.

    Returns:
        Vertices, faces and their kinds; None where the library refuses the mesh.
    """
    triangles = faces.astype(np.uint64)
    solid = Manifold(Mesh64(np.ascontiguousarray(vertices), triangles, face_id=kinds.astype(np.uint64)))
    if solid.status() != Error.NoError:
        return None
    for tolerance in tolerances:
        solid = solid.simplify(tolerance)
    merged = solid.to_mesh64()
    found = np.asarray(merged.tri_verts).astype(np.int64), np.asarray(merged.face_id).astype(np.int64)
    return np.asarray(merged.vert_properties), *found


def _loose_sides(faces: Int[ndarray, "f 3"], count: int) -> Bool[ndarray, " s"]:
    """Sides of faces without exactly one other at their edge, in the opposite direction."""
    forward = (faces < np.roll(faces, -1, axis=1)).reshape(-1)
    _, edge, uses = np.unique(edge_keys(faces, count), return_inverse=True, return_counts=True)
    ups = np.bincount(edge, forward, minlength=len(uses))
    loose: Bool[ndarray, " s"] = ((uses != 2) | (ups != 1))[edge]
    return loose
