"""Export of part-labelled meshes in part colours: PLY and GLB files, arrays for TensorBoard."""

import io
from pathlib import Path

import numpy as np
import trimesh
from jaxtyping import Float32, Int, Int32, UInt8
from numpy import ndarray
from trimesh.visual.material import PBRMaterial

from jointsdf.geometry.ply import binary_ply
from jointsdf.runs.files import write_atomically
from jointsdf.shapes.labels.face_order import order_record
from jointsdf.values import UNLABELLED, LabelledMesh
from jointsdf.viewing.palette import part_colours

TENSORBOARD_VERTICES = 65_535  # its page stores vertex indices as 16-bit integers


def write_mesh(folder: Path, mesh: LabelledMesh) -> None:
    """Write `mesh.ply`, `mesh.glb`, `labels.npy` and `labels.json`, each atomically.

    `mesh.ply` has float64 vertices and, per face, a colour and an integer `label`. `mesh.glb` has one named node and
    material per part. `labels.npy` is int64 in the face order of both `mesh` and `mesh.ply`, by which `labels.json`
    knows them again. An empty mesh has no `mesh.glb`: the format cannot hold one, and an older one is removed.

    Args:
        folder: Created where missing.
        mesh: File frame; labels below 2^31.
    """
    write_atomically(folder / "mesh.ply", ply_bytes(mesh))
    if mesh.is_empty:
        (folder / "mesh.glb").unlink(missing_ok=True)
    else:
        write_atomically(folder / "mesh.glb", glb_bytes(mesh))
    labels = io.BytesIO()
    np.save(labels, mesh.labels.astype(np.int64), allow_pickle=False)
    write_atomically(folder / "labels.npy", labels.getvalue())
    corners = mesh.vertices[mesh.faces]
    write_atomically(folder / "labels.json", order_record("mesh.ply", "labels.npy", labels.getvalue(), corners))


def tensorboard_mesh(
    mesh: LabelledMesh,
) -> tuple[Float32[ndarray, "1 v 3"], UInt8[ndarray, "1 v 3"], Int32[ndarray, "1 f 3"]]:
    """Vertices, vertex colours and faces for `SummaryWriter.add_mesh`; centred, longest side 2.

    Vertices at part borders are duplicated, so that each face has its part's colour.

    Args:
        mesh: Not empty.

    Raises:
        ValueError: More vertices than TensorBoard can show. One line, with the fix.
    """
    assert not mesh.is_empty, "TensorBoard cannot show an empty mesh"
    corners, faces = np.unique(_corners(mesh), return_inverse=True)
    if len(corners) > TENSORBOARD_VERTICES:
        raise ValueError(
            f"{len(corners)} vertices: TensorBoard shows at most {TENSORBOARD_VERTICES}; extract at a lower resolution"
        )
    part, vertex = np.divmod(corners, len(mesh.vertices))
    vertices = mesh.vertices[vertex]
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    vertices = (vertices - (low + high) / 2) * (2 / (high - low).max())
    colours = part_colours(part + UNLABELLED)
    return vertices.astype(np.float32)[None], colours[None], faces.reshape(1, -1, 3).astype(np.int32)


def fits_tensorboard(mesh: LabelledMesh) -> bool:
    """True if TensorBoard can show the mesh; see `tensorboard_mesh`."""
    return len(np.unique(_corners(mesh))) <= TENSORBOARD_VERTICES


def _corners(mesh: LabelledMesh) -> Int[ndarray, " c"]:
    """A key per corner of each face, equal for corners that share vertex and label."""
    return np.repeat(mesh.labels - UNLABELLED, 3) * len(mesh.vertices) + mesh.faces.reshape(-1)


def ply_bytes(mesh: LabelledMesh) -> bytes:
    """The content of `mesh.ply`."""
    red, green, blue = part_colours(mesh.labels).T
    opaque = np.full(len(mesh.faces), 255, dtype=np.uint8)
    labels = mesh.labels.astype("<i4")
    assert (labels == mesh.labels).all(), "a label beyond 32 bits"
    columns = {"red": red, "green": green, "blue": blue, "alpha": opaque, "label": labels}
    comment = "one part label per face, -1 where unlabelled"
    return binary_ply(mesh.vertices.astype("<f8"), mesh.faces, columns, comment)


def glb_bytes(mesh: LabelledMesh) -> bytes:
    """The content of `mesh.glb`; the mesh must have faces."""
    scene = trimesh.Scene()
    for part in np.unique(mesh.labels).tolist():
        vertices, faces = np.unique(mesh.faces[mesh.labels == part], return_inverse=True)
        name = "unlabelled" if part < 0 else f"part_{part}"
        geometry = trimesh.Trimesh(mesh.vertices[vertices], faces.reshape(-1, 3), process=False)
        material = PBRMaterial(name, baseColorFactor=_linear(part), metallicFactor=0.0, roughnessFactor=0.7)
        material.doubleSided = True
        geometry.visual = trimesh.visual.TextureVisuals(material=material)
        scene.add_geometry(geometry, node_name=name, geom_name=name)
    content: bytes = scene.export(file_type="glb")
    return content


def _linear(part: int) -> UInt8[ndarray, "4"]:
    """Linear colour (RGBA) of a part, as glTF stores material colours: the inverse sRGB curve (IEC 61966-2-1)."""
    srgb = part_colours(np.array([part]))[0] / 255
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    return np.append(np.rint(255 * linear), 255).astype(np.uint8)
