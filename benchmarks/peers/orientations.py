"""Oriented normals of a cloud, in three ways; a point without one has 0."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from benchmarks.peers import libraries
from jointsdf.data.surfels import Surfels

NEIGHBOURS = 30  # Open3D's own default of a plane, and of the graph that the orientation runs along
MESHLAB_NEIGHBOURS = 10  # MeshLab's default


def open3d_normals(points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
    """Planes of 30 neighbours, oriented along a minimum spanning tree (Hoppe et al. 1992), by Open3D."""
    library = libraries.open3d()
    cloud = library.geometry.PointCloud(library.utility.Vector3dVector(points))
    cloud.estimate_normals(library.geometry.KDTreeSearchParamKNN(NEIGHBOURS))
    cloud.orient_normals_consistent_tangent_plane(NEIGHBOURS)
    return outward(points, np.asarray(cloud.normals))


def meshlab_normals(points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
    """Planes of 10 neighbours, oriented along a minimum spanning tree (Hoppe et al. 1992), by MeshLab."""
    library = libraries.pymeshlab()
    meshes = library.MeshSet()
    meshes.add_mesh(library.Mesh(vertex_matrix=points))
    meshes.compute_normal_for_point_clouds(k=MESHLAB_NEIGHBOURS)
    return outward(points, np.array(meshes.current_mesh().vertex_normal_matrix()))


def surfel_normals(points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
    """Planes by consensus, oriented by free space (`jointsdf/data/surfels.py`)."""
    return Surfels(points).normals


def outward(points: Float[ndarray, "n 3"], normals: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
    """All normals, or all reversed: a spanning tree leaves the side open, and the volume that they tell decides it.

    By the divergence theorem the volume inside is a third of the area times the mean of (p - c) . n, here over points
    that are uniform by area.
    """
    told = float(((points - points.mean(axis=0)) * normals).sum())
    return normals if told >= 0 else -normals


ORIENTATIONS: dict[str, Callable[[Float[ndarray, "n 3"]], Float[ndarray, "n 3"]]] = {
    "open3d": open3d_normals,
    "meshlab": meshlab_normals,
    "surfels": surfel_normals,
}
