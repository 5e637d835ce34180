"""Screened Poisson surface reconstruction (Kazhdan and Hoppe 2013), by Open3D, and its usual clean-up."""

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.spatial import KDTree

from benchmarks.peers import libraries
from jointsdf.geometry.topology import face_components

LEAST = 100  # points with a normal, below which nothing is reconstructed
SPACING_NEIGHBOUR = 4  # the distance to this neighbour, in the median, is the spacing of the cloud
REACH = 3.0  # spacings within which a face has the support of the cloud
SUPPORTED = 0.5  # least share of a piece's faces with that support

Triangles = tuple[Float[ndarray, "v 3"], Int[ndarray, "f 3"]]


def screened_poisson(points: Float[ndarray, "n 3"], normals: Float[ndarray, "n 3"], depth: int) -> Triangles:
    """The surface of a cloud with outward normals, without the pieces that no points support.

    Nothing is cut off by density: that opens closed solids, which these clouds are of, wherever they are thin.

    Args:
        points: Any frame.
        normals: Of unit length; points with 0 are left out.
        depth: Of the octree: 2^depth cells along each side of a box 1.1 times as large as the cloud.
    """
    known = normals.any(axis=1)
    if known.sum() < LEAST:
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    library = libraries.open3d()
    cloud = library.geometry.PointCloud(library.utility.Vector3dVector(points[known]))
    cloud.normals = library.utility.Vector3dVector(normals[known])
    found, _ = library.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=depth, n_threads=1)
    return supported_pieces(np.asarray(found.vertices), np.asarray(found.triangles, dtype=np.int64), points)


def supported_pieces(
    vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], points: Float[ndarray, "n 3"]
) -> Triangles:
    """The connected pieces most of whose faces are near a point of the cloud, with the vertices that they use."""
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    if not len(faces):
        return np.zeros((0, 3)), faces
    tree = KDTree(points)
    spacing = np.median(tree.query(points, [SPACING_NEIGHBOUR + 1])[0])
    near = tree.query(vertices[faces].mean(axis=1))[0] <= REACH * spacing
    pieces = face_components(faces)
    shares = np.bincount(pieces, near) / np.bincount(pieces)
    kept = faces[shares[pieces] >= SUPPORTED]
    used, renumbered = np.unique(kept, return_inverse=True)
    return vertices[used], renumbered.reshape(-1, 3)
