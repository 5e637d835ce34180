"""Labels of faces from labelled points on the surface: `.xyzc` files."""

import logging
from pathlib import Path

import numpy as np
from jaxtyping import Int
from numpy import ndarray
from scipy.spatial import KDTree

from jointsdf.errors import InputError
from jointsdf.geometry.distance import ClosestPoint
from jointsdf.geometry.mesh import face_areas
from jointsdf.shapes.labels.ids import check_ids
from jointsdf.shapes.labels.text_files import read_table
from jointsdf.shapes.readers.file_mesh import FileMesh
from jointsdf.values import UNLABELLED, LabelledMesh

OFF_SURFACE = 0.01  # of the longest side: distance that 99 of 100 points keep below
SHARE = 99  # percentile
UNCOVERED = 0.1  # of the longest side: distance of a face's centre from the nearest point that is worth a warning

logger = logging.getLogger(__name__)


def read_point_labels(path: Path, mesh: FileMesh) -> Int[ndarray, " f"]:
    """Label each face as the labelled point nearest to its centre.

    Args:
        path: A text file with `x y z class` or `x y z nx ny nz class` in each line, in the frame of the mesh.
        mesh: The mesh file.

    Raises:
        InputError: The file holds no such lines, or points that do not lie on this mesh.
    """
    source = f"labels file {path}"
    table = read_table(path)
    if table.shape[1] not in (4, 7):
        raise InputError(
            f"{source} has {table.shape[1]} numbers in each line: write x y z class or x y z nx ny nz class"
        )
    points, labels = table[:, :3], check_ids(source, table[:, -1])
    surface = LabelledMesh(mesh.vertices, mesh.faces, np.full(len(mesh.faces), UNLABELLED))
    has_area = face_areas(surface) > 0
    proper = LabelledMesh(mesh.vertices, mesh.faces[has_area], surface.labels[has_area])
    size = float(np.ptp(mesh.vertices[mesh.faces].reshape(-1, 3), axis=0).max())
    if proper.is_empty or not np.isfinite(points).all():
        raise InputError(f"{source}: neither its points nor the mesh may be without extent or infinite")
    away = float(np.percentile(ClosestPoint(proper).query(points)[0], SHARE)) / max(size, np.finfo(float).tiny)
    if away > OFF_SURFACE:
        raise InputError(
            f"{source} is of another mesh: its points lie up to {away:.2g} of the longest side away from this one"
        )
    reach, nearest = KDTree(points).query(mesh.vertices[mesh.faces].mean(axis=1))
    if bare := int((reach > UNCOVERED * size).sum()):
        logger.warning(
            "%s: %d faces have no point within %g of the longest side; they take the label of the nearest one",
            *(source, bare, UNCOVERED),
        )
    return labels[nearest]
