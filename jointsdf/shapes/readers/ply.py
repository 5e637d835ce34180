"""Reader of PLY files (G. Turk, "The PLY Polygon File Format", 1994), text and binary.

Neither library serves. trimesh 5.2 cannot read faces of differing sizes from binary files, and does not tell which
polygon a triangle is of. plyfile 1.1.5, which the tests compare with, is under the GPL, makes room for as many rows as
a header declares, refuses 64-bit integers, which trimesh writes, and headers with a letter beyond ASCII, and reads
330,000 binary triangles in 1.3 s (this reader: 0.03 s; 300,000 faces of differing sizes: 1.2 s and 0.25 s).
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Int, Shaped
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.shapes.readers.face_columns import COLOUR, are_inside, majority, number_colours, polygon_mesh
from jointsdf.shapes.readers.file_mesh import FaceColumn, FileMesh, number_names
from jointsdf.shapes.readers.ply_binary import read_binary
from jointsdf.shapes.readers.ply_header import parse_header
from jointsdf.shapes.readers.ply_table import Lists, Table
from jointsdf.shapes.readers.ply_text import read_text
from jointsdf.shapes.readers.precision import warn_of_rounding
from jointsdf.values import Unit

AXES = ("x", "y", "z")
INDICES = ("vertex_indices", "vertex_index")  # usual names of the list of a face's corners
CHANNELS = (("red", "green", "blue"), ("diffuse_red", "diffuse_green", "diffuse_blue"))
ALPHA = ("alpha", "diffuse_alpha")
NO_COLUMNS = {*AXES, "nx", "ny", "nz", "s", "t", "u", "v", "texture_u", "texture_v", *ALPHA}
UNIT = re.compile(r"unit\s+(\S+)\s+(\d+\.?\d*(?:[eE][-+]?\d+)?)(\s+assumed)?")
RESTART = -1  # between two triangle strips


def read_ply(path: Path, data: bytes) -> FileMesh:
    """Read a PLY file.

    Columns are the scalar properties of its faces and vertices, and `colour`; of the vertices', those that most of a
    triangle's corners have. A comment `unit mm 0.001` gives the unit, with `assumed` where nobody said it; `up y` says
    that the y axis points up.

    Args:
        path: Names the file in messages.
        data: The file's content.

    Raises:
        InputError: It is no PLY file, cut, damaged, or has no triangles.
    """
    header = parse_header(path, data)
    tables = read_binary(path, header, data) if header.order else read_text(path, header, data)
    points, faces = tables.get("vertex", Table()), tables.get("face", Table())
    if not set(AXES) <= points.scalars.keys():
        raise InputError(f"{path} has no vertices with x, y and z: it is no mesh; export it again")
    vertices = np.stack([points.scalars[axis].astype(np.float64) for axis in AXES], axis=1)
    if header.order and points.scalars["x"].dtype == np.float32:
        warn_of_rounding(str(path), vertices)
    indices = _find_indices(path, faces)
    if indices is not None:
        mesh = polygon_mesh(str(path), vertices, indices.values, indices.sizes, _columns(faces.scalars))
    else:
        strips = _find_indices(path, tables.get("tristrips", Table()))
        if strips is None:
            raise InputError(f"{path} is a point cloud: {len(vertices)} points without faces; a mesh is needed")
        mesh = FileMesh(vertices, unroll_strips(strips.values, strips.sizes))
    columns = {**_vertex_columns(points.scalars, mesh), **mesh.columns}
    up = "y" if "up y" in header.comments else "z"
    return replace(mesh, columns=columns, unit=parse_unit(header.comments), up=up)


def _find_indices(path: Path, table: Table) -> Lists | None:
    """Find the list of the corners of each face: by its usual names, else the only list of integers."""
    whole = {name: each for name, each in table.lists.items() if each.values.dtype.kind in "iu"}
    named = next((name for name in INDICES if name in whole), None)
    if named is None and len(whole) == 1:
        [named] = whole
    if named is not None:
        found = whole[named]
        return Lists(found.values.astype(np.int64), found.sizes)
    if table.lists or table.scalars:
        raise InputError(f"{path} has faces without a list vertex_indices of integers: export it again")
    return None


def _columns(scalars: Mapping[str, Shaped[ndarray, " r"]]) -> dict[str, FaceColumn]:
    """Columns from the scalar properties of an element, with colours as one."""
    columns = {}
    left = dict(scalars)
    for channels in CHANNELS:
        if set(channels) <= left.keys():
            colours = np.stack([left.pop(channel) for channel in channels], axis=1)
            columns[COLOUR] = FaceColumn(number_colours(colours), are_ids=False)
    return columns | {name: FaceColumn(values, are_ids=True) for name, values in left.items() if name not in NO_COLUMNS}


def _vertex_columns(scalars: Mapping[str, Shaped[ndarray, " v"]], mesh: FileMesh) -> dict[str, FaceColumn]:
    """Columns from the vertices, where the faces have none of the same name and use no vertex out of range."""
    columns = {}
    for name, column in _columns(scalars).items() if are_inside(mesh) else ():
        if name not in mesh.columns:
            most = majority(column.values, mesh.faces)
            columns[name] = FaceColumn(most if column.are_ids else number_names(most), column.are_ids)
    return columns


def unroll_strips(values: Int[ndarray, " n"], sizes: Int[ndarray, " s"]) -> Int[ndarray, "f 3"]:
    """Unroll triangle strips: each corner makes a triangle with the two before it, every second one turned around.

    Args:
        values: Vertices of all strips; -1 ends a strip within a list.
        sizes: Length of each list.
    """
    ends = np.zeros(len(values) + 1, dtype=bool)
    ends[np.cumsum(sizes)] = True
    strip = np.cumsum((values == RESTART) | ends[:-1])
    corner = np.arange(len(values))
    fresh = np.flatnonzero(np.diff(strip, prepend=-1))
    first = fresh[np.searchsorted(fresh, corner, side="right") - 1]
    first = np.where(values[first] == RESTART, first + 1, first)
    last = corner[2:]
    whole = last[last - 2 >= first[2:]]
    faces: Int[ndarray, "f 3"] = np.stack([values[whole - 2], values[whole - 1], values[whole]], axis=1)
    odd = (whole - first[whole]) % 2 == 1
    faces[odd] = faces[odd][:, [1, 0, 2]]
    a, b, c = faces.T
    return faces[(a != b) & (b != c) & (c != a)]


def parse_unit(comments: Sequence[str]) -> Unit | None:
    """Parse the unit that a comment of the header gives, as our own files do."""
    for comment in comments:
        if (found := UNIT.fullmatch(comment)) and float(found[2]) > 0:
            return Unit(found[1], float(found[2]), known=found[3] is None)
    return None
