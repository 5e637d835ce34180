"""Export of part-labelled meshes in part colours: PLY and GLB files."""

import io
from pathlib import Path

import numpy as np

from jointsdf.geometry.ply import binary_ply
from jointsdf.runs.files import write_atomically
from jointsdf.shapes.labels.face_order import order_record
from jointsdf.values import ASSUMED_UNIT, LabelledMesh, Unit
from jointsdf.viewing.glb import glb_bytes
from jointsdf.viewing.palette import part_colours


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
