"""A part-labelled mesh that writes itself to a file."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from trimesh.exchange.stl import export_stl

from jointsdf.errors import InputError
from jointsdf.runs.files import write_atomically
from jointsdf.shapes.labels.columns import read_own_labels
from jointsdf.values import ASSUMED_UNIT, LabelledMesh, Unit
from jointsdf.viewing.export import ply_bytes
from jointsdf.viewing.glb import glb_bytes

FORMATS = ("ply", "glb", "obj", "stl", "off")
COARSE = 1e-5  # of the longest side: spacing of float32 coordinates from which they are refused
FAR = float(np.finfo(np.float32).max)


def stored_mesh(folder: Path, *, is_empty: bool) -> LabelledMesh:
    """Read the mesh that a finished run left in its folder; a field without a surface left none."""
    if is_empty:
        return LabelledMesh(np.zeros((0, 3)), np.zeros((0, 3), int), np.zeros(0, int))
    return read_own_labels(folder / "mesh.ply")


@dataclass(frozen=True)
class PartMesh(LabelledMesh):
    """A part-labelled triangle mesh that can be written to a file.

    Attributes:
        unit: Length unit of the vertices.
        up: Their axis that points up, `y` or `z`.
    """

    unit: Unit = ASSUMED_UNIT
    up: str = "z"

    def export(self, path: str | Path) -> Path:
        """Write the mesh: ply (part colours, `label` per face) and glb (a node per part) keep parts and unit.

        All are in file units but glb, which is in metres with the y axis up. Coordinates are float64 in ply, obj and
        off; float32 about the middle of the mesh in glb, and about the origin in stl.

        Args:
            path: Ends in ply, glb, obj, stl or off; its folder is made where it is not there.

        Returns:
            The path.

        Raises:
            InputError: Another ending, an empty mesh, or one too far from its origin for stl.
            OSError: The file cannot be written.
        """
        path = Path(path)
        kind = path.suffix.lower().lstrip(".")
        if kind not in FORMATS:
            raise InputError(f"{path}: format {kind or 'without suffix'} is not written; use {', '.join(FORMATS)}")
        if self.is_empty:
            raise InputError(f"{path}: the mesh is empty, the field has no surface in the training box")
        write_atomically(path, self._content(path, kind))
        return path

    def _content(self, path: Path, kind: str) -> bytes:
        if kind == "ply":
            return ply_bytes(self, self.unit, self.up)
        if kind == "glb":
            return glb_bytes(self, self.unit, self.up)
        if kind == "stl":
            size, far = np.ptp(self.vertices, axis=0).max(), np.abs(self.vertices).max()
            if far > FAR or np.spacing(np.float32(far)) > COARSE * size:
                raise InputError(
                    f"{path}: stl has 7 digits for a mesh of {size:.3g} at {far:.3g} {self.unit.name}: use ply or obj"
                )
            content: bytes = export_stl(trimesh.Trimesh(self.vertices, self.faces, process=False))
            return content
        points = "".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in self.vertices.tolist())  # repr: all digits
        if kind == "off":
            faces = "".join(f"3 {a} {b} {c}\n" for a, b, c in self.faces.tolist())
            return f"OFF\n{len(self.vertices)} {len(self.faces)} 0\n{points}{faces}".encode()
        faces = "".join(f"f {a} {b} {c}\n" for a, b, c in (self.faces + 1).tolist())
        return ("".join(f"v {point}\n" for point in points.splitlines()) + faces).encode()
