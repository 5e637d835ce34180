"""The field that a question is put to: of a run folder, or of a field file alone."""

import logging
from dataclasses import dataclass
from pathlib import Path

from jointsdf.errors import InputError
from jointsdf.extraction.extractor import Extraction
from jointsdf.extraction.resolution import LADDER
from jointsdf.model.field import JointField
from jointsdf.runs.folder import FIELD, grid_of, read_result
from jointsdf.runs.row import ROW_FILE
from jointsdf.shapes.readers.ply import parse_unit
from jointsdf.shapes.readers.ply_header import LONGEST, parse_header
from jointsdf.user_paths import expand_home
from jointsdf.values import ASSUMED_UNIT, LabelledMesh, Unit
from jointsdf.viewing.part_mesh import PartMesh, stored_mesh

MESH = "mesh.ply"

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class AskedRun:
    """A fitted field with what its folder says of its frame.

    Attributes:
        field: The field.
        folder: The run folder; None for a field file alone.
        unit: Of the file frame; assumed where no mesh beside the field names it.
        up: Axis of the file frame that points up.
        resolution: Grid points along each axis that the run's mesh was extracted with.
    """

    field: JointField
    folder: Path | None
    unit: Unit
    up: str
    resolution: int

    def extraction(self, resolution: int | None = None, *, sharp: bool = False) -> Extraction:
        """Marching cubes with the run's grid, or with another one; faces are cut along part borders."""
        return Extraction(resolution or self.resolution, borders="split", sharp=sharp)

    def mesh(self) -> LabelledMesh:
        """The run's own mesh, or where it has none that of its grid.

        Raises:
            InputError: The field has no surface.
        """
        field = self.field
        if self.folder is not None and (self.folder / MESH).is_file():
            mesh = stored_mesh(self.folder, is_empty=False)
        else:
            parts = field.network_sdf, field.network_part, field.normalisation
            mesh = self.extraction().labelled_mesh(*parts)
        if mesh.is_empty:
            raise InputError("the field has no surface in the training box")
        return mesh

    def as_part_mesh(self, mesh: LabelledMesh) -> PartMesh:
        """The mesh with the run's unit and axis, to be written."""
        return PartMesh(mesh.vertices, mesh.faces, mesh.labels, self.unit, self.up)


def open_run(name: str) -> AskedRun:
    """Open a run folder, or a field file. Of the folder its field, its row and the header of its mesh are read, and
    nothing of it is run.

    Args:
        name: Path of the folder or file.

    Raises:
        InputError: There is no field, or a file is damaged.
    """  # noqa: D205
    path = Path(expand_home(name))
    if not path.exists():
        raise InputError(f"{name}: no such folder or file; give a run folder, or its {FIELD}")
    folder = path if path.is_dir() else path.parent
    field = JointField.load(path / FIELD if path.is_dir() else path)
    if not path.is_dir() and (path.name != FIELD or not (folder / ROW_FILE).is_file()):
        return AskedRun(field, None, ASSUMED_UNIT, "z", LADDER[0])
    unit, up = _frame_of(folder / MESH)
    resolution = grid_of(folder, read_result(folder)) if (folder / ROW_FILE).is_file() else LADDER[0]
    return AskedRun(field, folder, unit, up, resolution)


def _frame_of(mesh: Path) -> tuple[Unit, str]:
    """Unit and upward axis by the comments of a run's mesh."""
    if not mesh.is_file():
        return ASSUMED_UNIT, "z"
    with mesh.open("rb") as file:
        comments = parse_header(mesh, file.read(LONGEST)).comments
    return parse_unit(comments) or ASSUMED_UNIT, "y" if "up y" in comments else "z"
