"""Triangles of any file that can be a shape: a mesh or STEP file."""

from dataclasses import replace
from pathlib import Path

from jaxtyping import Int
from numpy import ndarray

from jointsdf.shapes.readers import mesh_file, step
from jointsdf.shapes.readers.content import read_content
from jointsdf.shapes.readers.file_mesh import FileMesh


def read_triangles(
    path: Path, tessellation: step.Tessellation = step.DEFAULT
) -> tuple[FileMesh, Int[ndarray, " f"] | None]:
    """Read the triangles of a mesh or STEP file, in the order that its label files follow.

    Args:
        path: The file.
        tessellation: Of a STEP file.

    Returns:
        The triangles, and the B-rep face of each for a STEP file, None for any other.

    Raises:
        InputError: The file cannot be read.
    """
    content = read_content(path)
    if content.format != "step":
        return mesh_file.parse_mesh(path, content), None
    mesh = step.read_step(path, content.data, tessellation)
    return replace(mesh.file_mesh, sha256=content.sha256), mesh.patches
