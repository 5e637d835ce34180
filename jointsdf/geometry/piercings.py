"""Where the faces of a mesh pass through each other: its edges, cast as rays."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.geometry.mesh import edge_keys
from jointsdf.geometry.rays import successive_hits

APART = 1e-5  # of the longest side: an edge whose ends are nearer to a face's plane, or that meets its rim, touches it


@dataclass(frozen=True)
class Piercings:
    """Edges that pass through faces they have no corner in common with.

    Attributes:
        face: One of the faces at each edge.
        pierced: The face that it passes through.
        depth: Distance of the edge's nearer end from the plane of that face, of the longest side.
    """

    face: Int[ndarray, " n"]
    pierced: Int[ndarray, " n"]
    depth: Float[ndarray, " n"]


def find_piercings(vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]) -> Piercings:
    """Cast every edge as a ray: two surfaces that cross have an edge of one that passes through a face of the other.

    Args:
        vertices: Positions.
        faces: Vertex indices, none degenerate.
    """
    size = float(np.ptp(vertices, axis=0).max())
    centred = (vertices - (vertices.min(axis=0) + vertices.max(axis=0)) / 2) / size
    side = np.unique(edge_keys(faces, len(vertices)), return_index=True)[1]
    ends = np.stack([faces.ravel()[side], np.roll(faces, -1, axis=1).ravel()[side]], axis=1)
    start, end = centred[ends[:, 0]], centred[ends[:, 1]]
    lengths = np.linalg.norm(end - start, axis=1)
    corners = centred[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    hits = successive_hits(corners, start, (end - start) / lengths[:, None], lengths)
    found = [np.zeros((0, 2), dtype=np.int64), *(np.stack(pair, axis=1) for pair in hits)]
    edge, face = np.unique(np.concatenate(found), axis=0).T
    before, behind = (np.einsum("ij,ij->i", point[edge] - corners[face, 0], normals[face]) for point in (start, end))
    depth = np.where(before * behind < 0, np.minimum(np.abs(before), np.abs(behind)), 0.0)
    share = before / np.where(depth > 0, before - behind, 1.0)
    met = start[edge] + share[:, None] * (end - start)[edge]
    through = (depth > APART) & (_distance_from_rim(met, corners[face], normals[face]) > APART)
    return Piercings(side[edge[through]] // 3, face[through], depth[through])


def _distance_from_rim(
    points: Float[ndarray, "n 3"], corners: Float[ndarray, "n 3 3"], normals: Float[ndarray, "n 3"]
) -> Float[ndarray, " n"]:
    """Distance of a point in each face's plane from the nearest line of a side, negative beyond one."""
    along = np.roll(corners, -1, axis=1) - corners
    inward = np.cross(normals[:, None], along) / np.linalg.norm(along, axis=2, keepdims=True)
    return np.einsum("nij,nij->ni", inward, points[:, None] - corners).min(axis=1)
