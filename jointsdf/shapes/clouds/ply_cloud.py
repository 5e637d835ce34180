"""Point clouds in PLY files: those without faces."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from jointsdf.errors import InputError
from jointsdf.shapes.clouds.file_cloud import AXES, FileCloud, cloud_of_columns
from jointsdf.shapes.readers.ply import parse_unit
from jointsdf.shapes.readers.ply_binary import read_binary
from jointsdf.shapes.readers.ply_header import parse_header
from jointsdf.shapes.readers.ply_table import Table
from jointsdf.shapes.readers.ply_text import read_text
from jointsdf.shapes.readers.precision import warn_of_rounding

SURFACES = ("face", "tristrips")  # elements of meshes


def is_ply_cloud(data: bytes) -> bool:
    """True if a PLY file declares points and no faces; False for what cannot be read as PLY."""
    try:
        rows = {element.name: element.rows for element in parse_header(Path("cloud.ply"), data).elements}
    except InputError:
        return False
    return not any(rows.get(name) for name in SURFACES) and rows.get("vertex", 0) > 0


def read_ply(path: Path, data: bytes) -> FileCloud:
    """Read the points of a PLY file; the scalar properties of its vertices are the columns.

    Args:
        path: Names the file in messages.
        data: The file's content.

    Raises:
        InputError: It is no PLY file, cut, damaged, or has no vertices with x, y and z.
    """
    header = parse_header(path, data)
    tables = read_binary(path, header, data) if header.order else read_text(path, header, data)
    cloud = cloud_of_columns(str(path), tables.get("vertex", Table()).scalars)
    if header.order and tables["vertex"].scalars[AXES[0]].dtype == np.float32:
        warn_of_rounding(str(path), cloud.points)
    return replace(cloud, unit=parse_unit(header.comments), up="y" if "up y" in header.comments else "z")
