"""Reader of OFF files (Geomview's Object File Format).

Source: M. Phillips et al., "Geomview Manual", section "OFF Files". trimesh's reader is not used: it leaves out faces of
five and more corners without a word, and knows no colours of faces.
"""

import re
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.shapes.readers.face_columns import COLOUR, are_inside, majority, number_colours, polygon_mesh
from jointsdf.shapes.readers.file_mesh import FaceColumn, FileMesh, number_names
from jointsdf.shapes.readers.text_numbers import parse_floats, parse_integers, split_rows, warn_unless_ended

HEADER = re.compile(rb"(ST)?(C)?(N)?(4)?(n)?OFF(.*)", re.DOTALL)
ANY_CASE = re.compile(rb"(ST)?(C)?(N)?(4)?()OFF(.*)", re.DOTALL | re.IGNORECASE)
COLOUR_WORDS = (0, 1, 3, 4)  # after a face's corners: none, an index of a colour map, or a colour, with opacity or not

Rows = list[list[bytes]]


class Layout(NamedTuple):
    """What a vertex has beside its position: normal, colour, texture coordinates, in this order."""

    has_normals: bool
    has_colours: bool
    has_textures: bool


def read_off(path: Path, data: bytes) -> FileMesh:
    """Read an OFF, COFF, NOFF or STOFF file, or one of counts without a header; normals and textures are left out.

    Args:
        path: Names the file in messages.
        data: The file's content.

    Raises:
        InputError: It is no OFF file, binary, of four or n dimensions, cut or damaged.
    """
    rows = split_rows(data.removeprefix(b"\xef\xbb\xbf"), b"#")
    layout = _take_header(path, rows)
    num_vertices, num_faces = _take_counts(path, rows)
    vertices, of_vertices = _parse_vertices(path, rows, num_vertices, layout)
    corners, sizes, of_faces = _parse_faces(path, rows[num_vertices : num_vertices + num_faces], num_faces)
    if (more := len(rows) - num_vertices - num_faces) > 0:
        raise InputError(f"{path} is damaged: {more} lines follow its declared faces; export it again")
    warn_unless_ended(str(path), data)
    columns = {} if of_faces is None else {COLOUR: FaceColumn(of_faces, are_ids=False)}
    mesh = polygon_mesh(str(path), vertices, corners, sizes, columns)
    if of_vertices is None or of_faces is not None or not are_inside(mesh):
        return mesh
    colours = number_names(majority(of_vertices, mesh.faces))
    return replace(mesh, columns={COLOUR: FaceColumn(colours, are_ids=False)})


def _parse_vertices(
    path: Path, rows: Rows, declared: int, layout: Layout
) -> tuple[Float[ndarray, "v 3"], Int[ndarray, " v"] | None]:
    """Parse positions, and the number of each vertex's colour where there are colours."""
    fixed = 3 + 3 * layout.has_normals + 2 * layout.has_textures
    widths = (fixed + 3, fixed + 4) if layout.has_colours else (fixed,)
    wrong = next((number for number, row in enumerate(rows[:declared]) if len(row) not in widths), None)
    is_cut = wrong is not None and wrong == len(rows) - 1 and len(rows[wrong]) < widths[0]
    if len(rows) < declared or is_cut:
        held = len(rows) - int(is_cut)
        raise InputError(f"{path} is truncated: it declares {declared} vertices and holds {held}; export it again")
    if wrong is not None:
        expected, found = " or ".join(map(str, widths)), len(rows[wrong])
        raise InputError(
            f"{path} cannot be read as off: its vertex {wrong} has {found} numbers, not {expected}; export it again"
        )
    rows = rows[:declared]
    vertices = parse_floats(str(path), [word for row in rows for word in row[:3]]).reshape(-1, 3)
    if not layout.has_colours:
        return vertices, None
    first = 3 + 3 * layout.has_normals
    words = [word for row in rows for word in row[first : first + 3]]
    return vertices, number_colours(parse_floats(str(path), words).reshape(-1, 3))


def _take_header(path: Path, rows: Rows) -> Layout:
    """Take the header word from the first row."""
    first = rows[0] if rows else []
    word = first[0] if first else b""
    found = HEADER.fullmatch(word) or ANY_CASE.fullmatch(word)
    if not found:
        if first and all(re.fullmatch(rb"\d+", each) for each in first) and len(first) in (2, 3):
            return Layout(False, False, False)
        raise InputError(f"{path} cannot be read as off (truncated or damaged?): it has no header OFF; export it again")
    textured, coloured, normals, four, many, rest = found.groups()
    if four or many:
        name = word.decode("latin-1")
        raise InputError(f"{path} is {name}, of vertices in more than three dimensions: export it as plain OFF")
    if first[1:2] and first[1].upper() == b"BINARY":
        raise InputError(f"{path} is a binary OFF file, which is not read: export it as text OFF, PLY or STL")
    rows[0] = ([rest] if rest else []) + first[1:]
    if not rows[0]:
        del rows[0]
    return Layout(bool(normals), bool(coloured), bool(textured))


def _take_counts(path: Path, rows: Rows) -> tuple[int, int]:
    """Take the row of the numbers of vertices, faces and edges."""
    words = rows.pop(0) if rows else []
    if len(words) not in (2, 3) or not all(re.fullmatch(rb"\d{1,18}", word) for word in words):
        raise InputError(f"{path} cannot be read as off (truncated or damaged?): it has no counts; export it again")
    return int(words[0]), int(words[1])


def _parse_faces(
    path: Path, rows: Rows, declared: int
) -> tuple[Int[ndarray, " c"], Int[ndarray, " p"], Int[ndarray, " p"] | None]:
    """Parse the faces: corners, number of corners, and number of each one's colour, if any has one."""
    sizes = parse_integers(str(path), [row[0] for row in rows])
    beyond = np.array([len(row) - 1 for row in rows], dtype=np.int64) - sizes
    proper = np.isin(beyond, COLOUR_WORDS) & (sizes >= 0)
    wrong = np.flatnonzero(~proper)
    is_cut = len(wrong) > 0 and wrong[0] == len(rows) - 1 and beyond[-1] < 0
    if len(rows) < declared or is_cut:
        held = len(rows) - int(is_cut)
        raise InputError(f"{path} is truncated: it declares {declared} faces and holds {held}; export it again")
    if len(wrong):
        shown = b" ".join(rows[wrong[0]])[:40].decode("ascii", errors="replace")
        raise InputError(f"{path} cannot be read as off: its face {wrong[0]} is {shown!r}; export it again")
    pairs = list(zip(rows, sizes.tolist(), strict=True))
    corners = parse_integers(str(path), [word for row, size in pairs for word in row[1 : size + 1]])
    if not beyond.any():
        return corners, sizes, None
    rests = [row[size + 1 : size + 4] for row, size in pairs]
    padded = [word for rest in rests for word in [*rest, b"-1", b"-1", b"-1"][:3]]  # -1 is no colour
    return corners, sizes, number_colours(parse_floats(str(path), padded).reshape(-1, 3))
