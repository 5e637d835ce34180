"""Ray casting of a mesh by an orthographic camera: one ray per pixel, on the CPU by Embree."""

from dataclasses import dataclass

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from jointsdf.values import LabelledMesh

MARGIN = 1.06  # of the frame around the mesh
CREASE = np.cos(np.radians(35.0))  # cosine; normals are not averaged across faces that differ by more than this angle
START = 10  # pixels from the rays' origins to the nearest point of the mesh
LEAST_AREA = 1e-9  # pixels^2, of twice a projected triangle that is divided by
SHORTEST_SUM, TINY = 1e-12, 1e-30  # least lengths of summed normals and of cross products that are divided by


@dataclass(frozen=True)
class Camera:
    """An orthographic camera.

    Attributes:
        axes: Rows: to the right, up, and away from the viewer; orthonormal.
        centre: Point in the middle of the picture, file units.
        pixel: Side of a pixel, file units.
        width: Pixels.
        height: Pixels.
    """

    axes: Float[ndarray, "3 3"]
    centre: Float[ndarray, "3"]
    pixel: float
    width: int
    height: int

    def project(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """File frame -> pixels right of, above and behind the middle of the picture."""
        projected: ndarray = (points - self.centre) @ self.axes.T / self.pixel
        return projected


@dataclass(frozen=True)
class Hits:
    """First hit of each pixel's ray. Entries of pixels without a hit are zero.

    Attributes:
        faces: Index of the face, -1 without a hit.
        normals: Smooth unit normal towards the viewer, camera axes (right, up, away).
        slopes: Change of depth per pixel to the right and downwards on the face.
        depths: Distance behind the middle of the picture, pixels.
    """

    faces: Int[ndarray, "h w"]
    normals: Float[ndarray, "h w 3"]
    slopes: Float[ndarray, "h w 2"]
    depths: Float[ndarray, "h w"]

    @property
    def seen(self) -> Bool[ndarray, "h w"]:
        """Pixels with a hit."""
        return self.faces >= 0


def fit_camera(mesh: LabelledMesh, width: int, height: int, azimuth: float, elevation: float) -> Camera:
    """Fit the camera to a mesh, up to a margin.

    Args:
        mesh: Not empty, file frame.
        width: Pixels.
        height: Pixels.
        azimuth: Of the viewer about +z, from +x, degrees.
        elevation: Of the viewer above the xy plane, degrees, inside (-90, 90).
    """
    return fit_camera_to_points(mesh.vertices[np.unique(mesh.faces)], width, height, azimuth, elevation)


def fit_camera_to_points(
    points: Float[ndarray, "n 3"], width: int, height: int, azimuth: float, elevation: float
) -> Camera:
    """Fit the camera to points, as `fit_camera`."""
    axes = viewing_axes(azimuth, elevation)
    projected = points @ axes.T
    low, high = projected.min(axis=0), projected.max(axis=0)
    pixel = MARGIN * max((high[0] - low[0]) / width, (high[1] - low[1]) / height)
    return Camera(axes, (low + high) / 2 @ axes, float(pixel), width, height)


def viewing_axes(azimuth: float, elevation: float, up: str = "z") -> Float[ndarray, "3 3"]:
    """Axes of a camera that looks from a direction; for the y axis up, azimuth is about +y, from +z.

    Args:
        azimuth: Of the viewer about +z, from +x, degrees.
        elevation: Of the viewer above the xy plane, degrees, inside (-90, 90).
        up: `z` or `y`, the axis that points up.
    """
    turn, tilt = np.radians(azimuth), np.radians(elevation)
    right = np.array([-np.sin(turn), np.cos(turn), 0.0])
    away = -np.array([np.cos(tilt) * np.cos(turn), np.cos(tilt) * np.sin(turn), np.sin(tilt)])
    axes = np.stack([right, np.cross(right, away), away])
    return np.roll(axes, -1, axis=1) if up == "y" else axes


def cast_rays(mesh: LabelledMesh, camera: Camera) -> Hits:
    """Cast a ray through each pixel of the camera; face, normal, slope and depth of the first hit."""
    vertices = camera.project(mesh.vertices)
    corners = vertices[mesh.faces]
    faces = _first_faces(vertices, mesh.faces, camera)
    row, column = np.nonzero(faces >= 0)
    ids = faces[row, column]
    x, y = column + 0.5 - camera.width / 2, camera.height / 2 - row - 0.5
    weights, depth, slope = _on_faces(corners[ids], x, y)
    shown, compact = np.unique(ids, return_inverse=True)
    smooth = np.einsum("nc,ncd->nd", weights, _corner_normals(corners, mesh.faces, shown)[compact])
    smooth /= np.maximum(np.linalg.norm(smooth, axis=1, keepdims=True), SHORTEST_SUM)
    smooth *= np.where(smooth[:, 2:] > 0, -1, 1)
    size = (camera.height, camera.width)
    normals, slopes, depths = np.zeros((*size, 3)), np.zeros((*size, 2)), np.zeros(size)
    normals[row, column], slopes[row, column], depths[row, column] = smooth, slope, depth
    return Hits(faces, normals, slopes, depths)


def _first_faces(
    vertices: Float[ndarray, "v 3"], triangles: Int[ndarray, "f 3"], camera: Camera
) -> Int[ndarray, "h w"]:
    """Index of the first face on each pixel's ray, -1 without one; vertices from `Camera.project`."""
    scene = EmbreeScene()
    TriangleMesh(scene, vertices.astype(np.float32), triangles.astype(np.int32))
    x = np.arange(camera.width) + 0.5 - camera.width / 2
    y = camera.height / 2 - np.arange(camera.height) - 0.5
    origins = np.zeros((camera.height, camera.width, 3), dtype=np.float32)
    origins[..., 0], origins[..., 1], origins[..., 2] = x, y[:, None], vertices[triangles, 2].min() - START
    directions = np.broadcast_to(np.array([0, 0, 1], dtype=np.float32), origins.shape).reshape(-1, 3).copy()
    faces: ndarray = scene.run(origins.reshape(-1, 3), directions).astype(np.int64)
    return faces.reshape(camera.height, camera.width)


def _on_faces(
    corners: Float[ndarray, "n 3 3"], x: Float[ndarray, " n"], y: Float[ndarray, " n"]
) -> tuple[Float[ndarray, "n 3"], Float[ndarray, " n"], Float[ndarray, "n 2"]]:
    """Barycentric weights and depth of the points (x, y) of faces, and the depth's slope per pixel right and down."""
    (ax, ay, az), (bx, by, bz) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    area = ax * by - ay * bx
    area = np.where(np.abs(area) < LEAST_AREA, LEAST_AREA, area)
    dx, dy = x - corners[:, 0, 0], y - corners[:, 0, 1]
    second, third = (dx * by - dy * bx) / area, (ax * dy - ay * dx) / area
    weights = np.clip(np.stack([1 - second - third, second, third], axis=1), 0, 1)
    right, up = (az * by - ay * bz) / area, (ax * bz - az * bx) / area
    return weights, np.einsum("nc,nc->n", weights, corners[..., 2]), np.stack([right, -up], axis=1)


def _corner_normals(
    corners: Float[ndarray, "f 3 3"], faces: Int[ndarray, "f 3"], shown: Int[ndarray, " s"]
) -> Float[ndarray, "s 3 3"]:
    """Area-weighted mean normal at the three corners of the shown faces, over adjacent faces within `CREASE`."""
    weighted = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    unit = weighted / np.maximum(np.linalg.norm(weighted, axis=1, keepdims=True), TINY)
    order = np.argsort(faces, axis=None, kind="stable")
    starts = np.searchsorted(faces.reshape(-1)[order], np.arange(faces.max() + 2))
    vertices = faces[shown].reshape(-1)
    valence = starts[vertices + 1] - starts[vertices]
    corner = np.repeat(np.arange(len(vertices)), valence)
    rank = np.arange(len(corner)) - np.repeat(np.cumsum(valence) - valence, valence)
    other = order[starts[vertices][corner] + rank] // 3
    smooth = np.einsum("nd,nd->n", unit[shown[corner // 3]], unit[other]) > CREASE
    corner, other = corner[smooth], other[smooth]
    sums = [np.bincount(corner, weighted[other, axis], minlength=len(vertices)) for axis in range(3)]
    normals: ndarray = np.stack(sums, axis=1).reshape(-1, 3, 3)
    return normals / np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), TINY)
