"""A part-labelled mesh that writes itself to a file."""

from pathlib import Path

import trimesh

from jointsdf.errors import InputError
from jointsdf.runs.files import write_atomically
from jointsdf.values import LabelledMesh
from jointsdf.viewing.export import glb_bytes, ply_bytes

FORMATS = ("ply", "glb", "obj", "stl", "off")


class PartMesh(LabelledMesh):
    """A part-labelled triangle mesh that can be written to a file."""

    def export(self, path: str | Path) -> Path:
        """Write the mesh: ply (part colours, `label` per face) and glb (a node per part) keep the parts.

        Args:
            path: Ends in ply, glb, obj, stl or off; its folder is made where it is not there.

        Returns:
            The path.

        Raises:
            InputError: Another ending, or an empty mesh.
            OSError: The file cannot be written.
        """
        path = Path(path)
        kind = path.suffix.lower().lstrip(".")
        if kind not in FORMATS:
            raise InputError(f"{path}: format {kind or 'without suffix'} is not written; use {', '.join(FORMATS)}")
        if self.is_empty:
            raise InputError(f"{path}: the mesh is empty, the field has no surface in the training box")
        if kind in ("ply", "glb"):
            content = ply_bytes(self) if kind == "ply" else glb_bytes(self)
        else:
            exported = trimesh.Trimesh(self.vertices, self.faces, process=False).export(file_type=kind)
            content = exported if isinstance(exported, bytes) else str(exported).encode()
        write_atomically(path, content)
        return path
