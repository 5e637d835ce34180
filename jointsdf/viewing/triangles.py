"""Pictures that show the triangles of a mesh: each face in one shade, its sides as lines."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray

from jointsdf.geometry.mesh import face_normals
from jointsdf.values import LabelledMesh
from jointsdf.viewing.palette import part_colours
from jointsdf.viewing.raycast import Camera, Hits, cast_rays
from jointsdf.viewing.render import INK, notice, shade

LINE, DARK = 0.45, 0.6  # half width of a line, pixels of the finished picture; how dark it is
SHORTEST = 1e-9  # pixels^2, of a side that is divided by


def draw_triangles(mesh: LabelledMesh, camera: Camera, supersampling: int = 3) -> UInt8[ndarray, "h w 3"]:
    """Draw a mesh in part colours with the sides of its triangles, on white; "empty" for a mesh without faces.

    Args:
        mesh: File frame.
        camera: In pixels of the picture.
        supersampling: Rays per pixel along each axis.
    """
    width, height, by = camera.width, camera.height, supersampling
    if mesh.is_empty:
        return notice("empty", width, height)
    fine = replace(camera, pixel=camera.pixel / by, width=width * by, height=height * by)
    hits = cast_rays(mesh, fine)
    normals = face_normals(mesh.vertices, mesh.faces) @ camera.axes.T
    normals *= np.where(normals[:, 2:] > 0, -1, 1)
    picture = shade(part_colours(mesh.labels), replace(hits, normals=normals[hits.faces] * hits.seen[..., None]))
    lines = (_side_distances(mesh, fine, hits) < LINE * by)[..., None]
    picture += DARK * lines * (INK - picture)
    pixels = picture.reshape(height, by, width, by, 3).mean(axis=(1, 3))
    return np.rint(pixels).astype(np.uint8)


def _side_distances(mesh: LabelledMesh, camera: Camera, hits: Hits) -> Float[ndarray, "h w"]:
    """Distance of each pixel to the nearest side of its face, in the plane of the picture; infinite without a face."""
    row, column = np.nonzero(hits.seen)
    points = np.stack([column + 0.5 - camera.width / 2, camera.height / 2 - row - 0.5], axis=1)
    corners = camera.project(mesh.vertices)[mesh.faces[hits.faces[row, column]], :2]
    nearest = np.full(len(points), np.inf)
    for k in range(3):
        start, end = corners[:, k], corners[:, (k + 1) % 3]
        along = end - start
        share = np.einsum("nd,nd->n", points - start, along) / np.maximum((along**2).sum(axis=1), SHORTEST)
        foot = start + np.clip(share, 0, 1)[:, None] * along
        nearest = np.minimum(nearest, np.linalg.norm(points - foot, axis=1))
    distances = np.full(hits.faces.shape, np.inf)
    distances[row, column] = nearest
    return distances
