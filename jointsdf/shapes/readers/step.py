"""Reader of STEP files as triangles in the file's length unit, each with its B-rep face, body and colour."""

import importlib.util
import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.errors import InputError, require_number
from jointsdf.shapes.readers.file_mesh import FaceColumn, FileMesh, number_names
from jointsdf.shapes.readers.precision import COARSE
from jointsdf.shapes.readers.step_bodies import weld
from jointsdf.shapes.readers.step_process import run_worker
from jointsdf.shapes.readers.step_units import read_length_units
from jointsdf.shapes.units import unit_of_metres
from jointsdf.values import Unit

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class StepMesh:
    """The tessellated solids of one STEP file.

    Attributes:
        vertices: Positions in the file's length unit; one per position of each body.
        faces: Vertex indices, none degenerate.
        patches: The B-rep face of each triangle, numbered through all bodies of the file.
        surfaces: Analytic type of each B-rep face: plane, cylinder, cone, sphere, torus, or other.
        bodies: The body of each triangle.
        colours: The colour of each triangle, one for a whole B-rep face, numbered in the order of the triangles; None
            for a file of one colour.
        unit: Length unit of the file; None where it names none.
    """

    vertices: Float[ndarray, "v 3"]
    faces: Int[ndarray, "f 3"]
    patches: Int[ndarray, " f"]
    surfaces: tuple[str, ...]
    bodies: Int[ndarray, " f"]
    colours: Int[ndarray, " f"] | None = None
    unit: Unit | None = None

    @property
    def file_mesh(self) -> FileMesh:
        """The triangles with their columns: `face`, `body`, and `colour` where there are several."""
        columns = {"face": FaceColumn(self.patches, are_ids=True), "body": FaceColumn(self.bodies, are_ids=False)}
        if self.colours is not None:
            columns["colour"] = FaceColumn(self.colours, are_ids=False)
        return FileMesh(self.vertices, self.faces, columns=columns, unit=self.unit)


@dataclass(frozen=True)
class Tessellation:
    """Resolution of a STEP file's triangles.

    Attributes:
        tolerance: Largest distance from the true surface, relative to the longest side of the file's box.
        angle: Largest angle between neighbouring chords of a curve, radians.

    Raises:
        InputError: A value out of its range.
    """

    tolerance: float = 1e-4
    angle: float = 0.1

    def __post_init__(self) -> None:
        """Check the ranges."""
        require_number("tessellation.tolerance", self.tolerance, 1e-6, 0.1)
        require_number("tessellation.angle", self.angle, 1e-3, 1.0)


DEFAULT = Tessellation()


def read_step(path: Path, data: bytes, tessellation: Tessellation = DEFAULT) -> StepMesh:
    """Tessellate a STEP file.

    Args:
        path: Names the file in messages.
        data: Its content.
        tessellation: Resolution of the triangles.

    Raises:
        InputError: The content is no STEP file, truncated, damaged, without a surface, in a unit of unknown size, or
            takes too much time or memory; or cascadio, which reads STEP, is not installed.
    """
    data = data.removeprefix(b"\xef\xbb\xbf")  # the mark of UTF-8, which the kernel does not know
    if not data.lstrip(b" \t\r\n").startswith(b"ISO-10303-21"):
        raise InputError(f"{path} is no STEP file: it does not begin with ISO-10303-21; export it again")
    if b"END-ISO-10303-21" not in data:
        raise InputError(f"{path} is truncated: END-ISO-10303-21 is missing; export it again")
    if importlib.util.find_spec("cascadio") is None:
        raise InputError(f"{path}: STEP needs cascadio: pip install 'jointsdf[step]' (in a checkout '.[step]')")
    units = read_length_units(path, data)
    arrays = run_worker(path, units.content, tessellation.tolerance, tessellation.angle)
    corners = arrays["vertices"][arrays["faces"]]
    if not np.isfinite(corners).all() or not np.ptp(corners, axis=1).any():
        raise InputError(f"{path} is damaged: it has infinite coordinates or no extent; export it again")
    vertices, faces, bodies, kept = weld(*(arrays[key] for key in ("vertices", "faces", "patches", "products")))
    unit = unit_of_metres(units.metres)
    spacing, size = float(arrays["spacing"]) / units.kernel_metres, np.ptp(vertices, axis=0).max() / units.kernel_metres
    if spacing > COARSE * size:
        logger.warning(
            "%s: far from its origin: the CAD kernel gives coordinates in steps of %.2g %s; move it to the origin",
            *(path, spacing, unit.name),
        )
    return StepMesh(
        vertices / units.kernel_metres,
        faces,
        arrays["patches"][kept],
        tuple(str(each) for each in arrays["surfaces"]),
        bodies,
        number_names(arrays["colours"][kept]) if "colours" in arrays else None,
        unit if units.known else None,
    )
