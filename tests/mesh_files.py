"""Mesh files of a box and a tetrahedron, written, damaged and loaded."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh

from jointsdf import shapes
from jointsdf.values import Shape

BOX = trimesh.creation.box((2.0, 3.0, 4.0), transform=trimesh.transformations.translation_matrix((5, 6, 7)))
SIDES = np.unique(np.round(BOX.face_normals), axis=0, return_inverse=True)[1].ravel()
AXES = np.abs(BOX.face_normals).argmax(axis=1)  # areas of the two sides along each axis: 24, 16, 12
COLOURS = np.array([[9, 9, 200], [255, 0, 1], [255, 0, 0]], dtype=np.uint8)[AXES]
TETRA_VERTICES = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
TETRA_FACES = "3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n"
PLY_HEADER = (
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z\n"
    "element face 4\nproperty list uchar int vertex_indices\nend_header\n"
)
PLY = PLY_HEADER + TETRA_VERTICES + TETRA_FACES
OFF = "OFF\n4 4 0\n" + TETRA_VERTICES + TETRA_FACES
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


def exported(kind: str) -> bytes:
    data = BOX.export(file_type=kind)
    return data.encode() if isinstance(data, str) else data


def flipped(count: int) -> Callable[[], bytes]:
    def export() -> bytes:
        faces = BOX.faces.copy()
        faces[:count] = faces[:count, ::-1]
        return trimesh.Trimesh(BOX.vertices, faces, process=False).export(file_type="ply")

    return export


def load(shape: Path | str, **options: object) -> Shape:
    return shapes.load(str(shape), **{"abc_root": "nowhere", "segmented": False} | options)


def put(folder: Path, name: str, content: bytes | str) -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def signed_volume(shape: Shape) -> float:
    a, b, c = shape.mesh.vertices[shape.mesh.faces].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def painted(name: str = "label", values: np.ndarray | None = None, order: np.ndarray | None = None) -> str:
    """The box as a text PLY with one value per face: a property, or three colours."""
    order = np.arange(12) if order is None else order
    values = SIDES if values is None else values
    names = ("red", "green", "blue") if name == "colour" else (name,)
    rows = np.column_stack([np.full(12, 3), BOX.faces, values])[order]
    kind = "float" if values.dtype.kind == "f" else "int"
    header = ["ply", "format ascii 1.0", "element vertex 8", *(f"property double {axis}" for axis in "xyz")]
    header += ["element face 12", "property list uchar int vertex_indices"]
    header += [f"property {'uchar' if name == 'colour' else kind} {column}" for column in names] + ["end_header"]
    number = (lambda x: f"{x:.3f}") if kind == "float" else (lambda x: str(int(x)))
    lines = [" ".join(map(repr, map(float, vertex))) for vertex in BOX.vertices]
    lines += [" ".join([*(str(int(x)) for x in row[:4]), *map(number, row[4:])]) for row in rows]
    return "\n".join([*header, *lines]) + "\n"
