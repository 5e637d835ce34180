"""Meshes for TensorBoard's mesh tab: upright, in part colours, with few enough vertices."""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Float32, Int, Int32, UInt8
from numpy import ndarray

from jointsdf.extraction.flat_regions import merge_flat_regions
from jointsdf.extraction.surface_changes import unsound_faces
from jointsdf.values import UNLABELLED, LabelledMesh
from jointsdf.viewing.palette import part_colours
from jointsdf.viewing.raycast import viewing_axes
from jointsdf.viewing.render import AZIMUTH, ELEVATION

VERTICES = 65_535  # its page stores vertex indices as 16-bit integers
TOLERANCES = (5e-5, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3)  # of the longest side; the surface moves by up to twice as much
DISTANCE = 3.0  # of the camera, in half longest sides
LIGHTS = [
    {"cls": "AmbientLight", "color": "#ffffff", "intensity": 0.9},
    {"cls": "DirectionalLight", "color": "#ffffff", "intensity": 0.7, "position": [1, 2, 3]},
]


class Arrays(NamedTuple):
    """Arguments of `SummaryWriter.add_mesh`."""

    vertices: Float32[ndarray, "1 v 3"]
    colours: UInt8[ndarray, "1 v 3"]
    faces: Int32[ndarray, "1 f 3"]


def decimate(mesh: LabelledMesh) -> LabelledMesh | None:
    """The mesh with nearly flat regions merged until TensorBoard can show it, by the smallest tolerance that does.

    Args:
        mesh: Any frame.

    Returns:
        The mesh itself where it fits; None where no tolerance is enough, or the mesh cannot be merged.
    """
    if fits(mesh):
        return mesh
    side = float(np.ptp(mesh.vertices[mesh.faces].reshape(-1, 3), axis=0).max())
    fixed = unsound_faces(mesh, np.ones(len(mesh.faces), dtype=bool))
    for tolerance in TOLERANCES:
        merged = merge_flat_regions(mesh, [tolerance * side], fixed)
        if merged is not None and not merged.is_empty and fits(merged):
            return merged
    return None


def fits(mesh: LabelledMesh) -> bool:
    """True if TensorBoard can show the mesh."""
    return len(np.unique(_corners(mesh))) <= VERTICES


def to_arrays(mesh: LabelledMesh, box: LabelledMesh, up: str) -> Arrays:
    """Vertices, vertex colours and faces; y up, as the page shows them.

    Vertices at part borders are duplicated, so that each face has its part's colour.

    Args:
        mesh: Not empty, and `fits`.
        box: The mesh whose box is centred and scaled to a longest side of 2: one for all that are compared.
        up: The axis that points up, `y` or `z`.
    """
    corners, faces = np.unique(_corners(mesh), return_inverse=True)
    assert len(corners) <= VERTICES, f"{len(corners)} vertices, which the page would show as others"
    part, vertex = np.divmod(corners, len(mesh.vertices))
    framed = box.vertices[np.unique(box.faces)]
    low, high = framed.min(axis=0), framed.max(axis=0)
    vertices = _upright((mesh.vertices[vertex] - (low + high) / 2) * (2 / (high - low).max()), up)
    colours = part_colours(part + UNLABELLED)
    return Arrays(vertices.astype(np.float32)[None], colours[None], faces.reshape(1, -1, 3).astype(np.int32))


def scene() -> dict[str, Any]:
    """Camera and lights of the page, from where the other pictures look."""
    towards = _upright(-viewing_axes(AZIMUTH, ELEVATION)[2:], "z")[0]
    camera = {"cls": "PerspectiveCamera", "fov": 50, "position": (DISTANCE * towards).tolist()}
    return {"camera": camera, "lights": LIGHTS}


def _upright(points: Float[ndarray, "n 3"], up: str) -> Float[ndarray, "n 3"]:
    """To the y axis up: (x, y, z) -> (x, z, -y)."""
    return points if up == "y" else points[:, [0, 2, 1]] * [1.0, 1.0, -1.0]


def _corners(mesh: LabelledMesh) -> Int[ndarray, " c"]:
    """A key per corner of each face, equal for corners that share vertex and label."""
    return np.repeat(mesh.labels - UNLABELLED, 3) * len(mesh.vertices) + mesh.faces.reshape(-1)
