"""Export of part-labelled meshes in part colours: PLY and GLB files, arrays for TensorBoard."""

import io
from pathlib import Path

import numpy as np
from jaxtyping import Float32, Int, Int32, UInt8
from numpy import ndarray

from jointsdf.geometry.ply import binary_ply
from jointsdf.runs.files import write_atomically
from jointsdf.shapes.labels.face_order import order_record
from jointsdf.values import ASSUMED_UNIT, UNLABELLED, LabelledMesh, Unit
from jointsdf.viewing.glb import glb_bytes
from jointsdf.viewing.palette import part_colours

TENSORBOARD_VERTICES = 65_535  # its page stores vertex indices as 16-bit integers


def write_mesh(folder: Path, mesh: LabelledMesh, unit: Unit = ASSUMED_UNIT, up: str = "z") -> None:
    """Write `mesh.ply`, `mesh.glb`, `labels.npy` and `labels.json`, each atomically.

    `mesh.ply` has float64 vertices in file units, unit and axis in comments and, per face, a colour and an integer
    `label`. `mesh.glb` has one named node and material per part, in metres with the y axis up, as glTF is. `labels.npy`
    is int64 in the face order of both `mesh` and `mesh.ply`, by which `labels.json` knows them again. An empty mesh has
    no `mesh.glb`: the format cannot hold one, and an older one is removed.

    Args:
        folder: Created where missing.
        mesh: File frame; labels below 2^31.
        unit: Of the file frame.
        up: Its axis that points up, `y` or `z`.
    """
    write_atomically(folder / "mesh.ply", ply_bytes(mesh, unit, up))
    if mesh.is_empty:
        (folder / "mesh.glb").unlink(missing_ok=True)
    else:
        write_atomically(folder / "mesh.glb", glb_bytes(mesh, unit, up))
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


def ply_bytes(mesh: LabelledMesh, unit: Unit, up: str) -> bytes:
    """The content of `mesh.ply`; the arguments are those of `write_mesh`."""
    red, green, blue = part_colours(mesh.labels).T
    opaque = np.full(len(mesh.faces), 255, dtype=np.uint8)
    labels = mesh.labels.astype("<i4")
    assert (labels == mesh.labels).all(), "a label beyond 32 bits"
    columns = {"red": red, "green": green, "blue": blue, "alpha": opaque, "label": labels}
    comments = ("one part label per face, -1 where unlabelled", _unit_comment(unit), *(["up y"] if up == "y" else []))
    return binary_ply(mesh.vertices.astype("<f8"), mesh.faces, columns, *comments)


def _unit_comment(unit: Unit) -> str:
    """The unit as the reader of PLY files understands it.

    >>> _unit_comment(ASSUMED_UNIT)
    'unit mm 0.001 assumed'
    """
    return f"unit {unit.name} {unit.metres!r}" + ("" if unit.known else " assumed")
