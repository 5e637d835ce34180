"""Reader of OBJ files: polygons in the file's order, with groups, objects, materials and colours of vertices.

Format: Wavefront, "Object Files (.obj)", Advanced Visualizer manual, appendix B1. The library trimesh is not used: it
reorders faces by material, cuts polygons into fans, and skips what it cannot parse.
"""

import logging
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.shapes.readers.face_columns import COLOUR, majority, number_colours, polygon_mesh
from jointsdf.shapes.readers.file_mesh import FaceColumn, FileMesh, number_names
from jointsdf.shapes.readers.obj_numbers import LONGEST_WORD, LineError, parse_lines
from jointsdf.shapes.readers.obj_text import decode, split_lines

NAMED = {"g": "group", "o": "object", "usemtl": "material"}
FIRST_NAMES = {"group": "default", "object": "", "material": ""}  # of faces before the first statement
FREE_FORM = ("surf", "curv", "curv2")
KNOWN = {
    "vt", "vn", "vp", "l", "p", "s", "mg", "mtllib", "maplib", "usemap", "lod", "bevel", "c_interp", "d_interp",
    "shadow_obj", "trace_obj", "cstype", "deg", "bmat", "step", "surf", "curv", "curv2", "parm", "trim", "hole", "scrv",
    "sp", "end", "con", "stech", "ctech",
}  # fmt: skip

logger = logging.getLogger(__name__)


@dataclass
class Statements:
    """Statements of an OBJ file.

    Attributes:
        positions: Words after each `v`.
        position_lines: Line of each.
        faces: Words after each `f`.
        face_lines: Line of each.
        before: Number of `v` before each `f`, which negative indices count back from.
        names: By column, each `g`, `o` or `usemtl`: the number of the next face, and the name.
        others: Number of statements by any other keyword.
    """

    positions: list[str] = field(default_factory=list)
    position_lines: list[int] = field(default_factory=list)
    faces: list[str] = field(default_factory=list)
    face_lines: list[int] = field(default_factory=list)
    before: list[int] = field(default_factory=list)
    names: dict[str, list[tuple[int, str]]] = field(default_factory=dict)
    others: Counter[str] = field(default_factory=Counter)


def read_obj(path: Path, data: bytes) -> FileMesh:
    """Read an OBJ file: faces with columns `group`, `object`, `material` and, of coloured vertices, `colour`.

    Args:
        path: Names the file in messages.
        data: Its content, in UTF-8, UTF-16 (with byte order mark) or Latin-1.

    Raises:
        InputError: A line is damaged, truncated or uses a vertex that does not exist, or there are only free-form
            surfaces.
    """
    text = decode(data)
    found = collect_statements(split_lines(text))
    _check_content(path, found)
    vertices, colours = _parse_positions(path, found)
    corners, sizes = _parse_faces(path, found, len(vertices))
    _check_end(path, text, found, sizes)
    proper = sizes >= 3
    if left_out := int((~proper).sum()) + found.others["l"] + found.others["p"]:
        logger.warning("%s: %d lines, points or faces of two corners are left out", path, left_out)
    numbers = {name: _number(events, len(sizes), name)[proper] for name, events in found.names.items()}
    columns = {name: FaceColumn(number_names(each), False) for name, each in numbers.items()}
    mesh = polygon_mesh(str(path), vertices, corners[np.repeat(proper, sizes)], sizes[proper], columns)
    if colours is not None and len(mesh.faces):
        values = number_names(majority(number_colours(colours), mesh.faces))
        mesh = replace(mesh, columns={**mesh.columns, COLOUR: FaceColumn(values, False)})
    return mesh


def collect_statements(lines: Iterable[str]) -> Statements:
    """Collect the statements of a file, whose numbers are not parsed yet."""
    found = Statements()
    for number, line in enumerate(lines, 1):
        words = line.split(None, 1)
        if not words or words[0][0] == "#":
            continue
        key, rest = words[0], words[1] if len(words) == 2 else ""
        if key == "v":
            found.positions.append(rest.partition("#")[0])
            found.position_lines.append(number)
        elif key in ("f", "fo"):  # `fo`: of version 2 of the format
            found.faces.append(rest.partition("#")[0])
            found.face_lines.append(number)
            found.before.append(len(found.positions))
        elif key in NAMED:
            found.names.setdefault(NAMED[key], []).append((len(found.faces), " ".join(rest.split())))
        else:
            found.others[key] += 1
    return found


def _check_content(path: Path, found: Statements) -> None:
    """Refuse files without faces, in words that say what they hold; warn of what is not read."""
    surfaces = [key for key in FREE_FORM if found.others[key]]
    if surfaces and not found.faces:
        raise InputError(f"{path} has free-form surfaces ({', '.join(surfaces)}), no faces: export it as a mesh")
    if surfaces:
        logger.warning("%s: its free-form surfaces (%s) are left out, only faces are read", path, ", ".join(surfaces))
    unknown = [key for key in found.others if key not in KNOWN]
    if unknown and not found.positions and not found.faces:
        raise InputError(f"{path} has no faces, and {unknown[0][:LONGEST_WORD]!r} is no OBJ statement: export it again")
    if unknown:
        count, first = sum(found.others[key] for key in unknown), unknown[0][:LONGEST_WORD]
        logger.warning("%s: %d lines are no OBJ statements (first: %r) and are left out", path, count, first)


def _parse_positions(path: Path, found: Statements) -> tuple[Float[ndarray, "v 3"], Float[ndarray, "v 3"] | None]:
    """Parse the positions, and the colours of vertices; a vertex without colour among others has -1."""
    try:
        values, sizes = parse_lines(found.positions, float, least=3)
    except LineError as error:
        raise _damaged(path, found.position_lines[error.line], str(error)) from error
    first = (np.cumsum(sizes) - sizes)[:, None] + np.arange(3)
    coloured = sizes >= 6  # four numbers: the last one is a weight
    if not coloured.any():
        return values[first], None
    colours = np.full((len(sizes), 3), -1.0)
    colours[coloured] = values[first[coloured] + 3]
    return values[first], colours


def _parse_faces(path: Path, found: Statements, num_vertices: int) -> tuple[Int[ndarray, " c"], Int[ndarray, " p"]]:
    """Parse the corners of all faces and their numbers."""
    try:
        written, sizes = parse_lines(found.faces, int, least=2, end="/")
    except LineError as error:
        raise _damaged(path, found.face_lines[error.line], str(error)) from error
    face = np.repeat(np.arange(len(sizes)), sizes)
    corners = np.where(written > 0, written - 1, np.array(found.before, dtype=np.int64)[face] + written)
    outside = np.flatnonzero((corners < 0) | (corners >= num_vertices) | (written == 0))
    if len(outside):
        vertex, line = written[outside[0]], found.face_lines[face[outside[0]]]
        raise _damaged(path, line, f"vertex {vertex} is out of range 1..{num_vertices}")
    return corners, sizes


def _check_end(path: Path, text: str, found: Statements, sizes: Int[ndarray, " p"]) -> None:
    """Refuse a file that ends within a face; warn where it may end within a number."""
    if text.endswith(("\n", "\r")):
        return
    is_last = bool(found.face_lines) and found.face_lines[-1] > max(found.position_lines, default=0)
    if is_last and sizes[-1] < 3:
        raise _damaged(path, found.face_lines[-1], "the file ends within a face")
    logger.warning("%s: its last line does not end in a line break: were it cut, a number could lack digits", path)


def _number(events: list[tuple[int, str]], count: int, column: str) -> Int[ndarray, " f"]:
    """Number the name that each face has under a column."""
    numbers: dict[str, int] = {}
    starts, names = zip((0, FIRST_NAMES[column]), *events, strict=True)
    of_event = [numbers.setdefault(name, len(numbers)) for name in names]
    return np.repeat(of_event, np.diff([*starts, count]))


def _damaged(path: Path, line: int, words: str) -> InputError:
    return InputError(f"{path} cannot be read as obj, line {line}: {words}; export it again")
