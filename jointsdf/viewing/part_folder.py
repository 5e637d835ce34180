"""Files of the parts of a mesh: `part_<id>.ply` or `.stl`."""

import re
from collections.abc import Mapping
from pathlib import Path

from jointsdf.errors import InputError, require_one_of
from jointsdf.geometry.mesh import used_vertices
from jointsdf.values import LabelledMesh, Unit
from jointsdf.viewing.part_mesh import PartMesh

FOLDER = "parts"  # of a run folder
SUFFIXES = ("ply", "stl")


def open_parts(mesh: LabelledMesh) -> dict[int, LabelledMesh]:
    """The surface of each part, as it is in the mesh, by part id.

    Raises:
        InputError: No face has a part.
    """
    if not len(mesh.part_ids):
        raise InputError("the surface has no parts (head=none); fit with a head")
    parts = {}
    for part in mesh.part_ids.tolist():
        chosen = mesh.labels == part
        used, faces = used_vertices(mesh.faces[chosen], len(mesh.vertices))
        parts[part] = LabelledMesh(mesh.vertices[used], faces, mesh.labels[chosen])
    return parts


def write_parts(folder: Path, parts: Mapping[int, LabelledMesh], suffix: str, unit: Unit, up: str) -> None:
    """Write a file for each part, each atomically; files of parts that are no longer there are removed.

    Args:
        folder: Made where it is not there.
        parts: Meshes by part id, file frame.
        suffix: ply or stl.
        unit: Of the file frame.
        up: Its axis that points up.

    Raises:
        InputError: Another suffix, or a part too far from its origin for stl.
    """
    require_one_of("format", suffix, SUFFIXES)
    for part, mesh in parts.items():
        PartMesh(mesh.vertices, mesh.faces, mesh.labels, unit, up).export(folder / f"part_{part}.{suffix}")
    for path in folder.glob(f"part_*.{suffix}"):
        if (found := re.fullmatch(r"part_(\d+)", path.stem)) and int(found[1]) not in parts:
            path.unlink()
