"""Reader of STL files, text and binary.

Source: M. Burns, "Automated Fabrication", 1993, section 6.5; colours as VisCAM, SolidView and Materialise Magics store
them. trimesh's reader is not used: of text it takes `vertex` in a name for a vertex, leaves out solids without an end
and what follows a number with a comma, and it refuses binary files with a byte too many.
"""

import logging
import re
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int, UInt16
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.geometry.mesh import edge_uses
from jointsdf.shapes.readers.face_columns import COLOUR
from jointsdf.shapes.readers.file_mesh import FaceColumn, FileMesh, number_names
from jointsdf.shapes.readers.precision import warn_of_rounding
from jointsdf.shapes.readers.stl_text import parse_facets

HEADER = 84  # bytes up to and with the number of faces
FACE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
UNKNOWN = (0, 0xFFFFFFFF)  # numbers of faces that programs write which do not know it
SOLID = "solid"
TEXT = re.compile(rb"(?:\xef\xbb\xbf)?\s*solid\b", re.IGNORECASE)
KEYWORD = re.compile(rb"[\r\n]\s*(?:facet|end[ \t]*solid)\b", re.IGNORECASE)
BEGINNING = 4096  # bytes of a text within which its first facet begins

logger = logging.getLogger(__name__)


def read_stl(path: Path, data: bytes) -> FileMesh:
    """Read an STL file: three vertices of their own for each face.

    Columns are `solid`, where a text has several, and `colour`, where a binary file has several.

    Args:
        path: Names the file in messages.
        data: The file's content.

    Raises:
        InputError: It is no STL file, cut or damaged.
    """
    if not is_whole_binary(data) and _is_text(data):
        return _read_text(path, data)
    records = _find_records(path, data)
    corners = records["corners"].astype(np.float64)
    warn_of_rounding(str(path), corners.reshape(-1, 3))
    colours = number_colours(data[: HEADER - 4], records["attribute"])
    columns = {COLOUR: FaceColumn(colours, are_ids=False)} if colours.any() else {}
    return _mesh(corners, columns)


def is_whole_binary(data: bytes) -> bool:
    """Whether the file is a binary STL beyond doubt: as long as its number of faces says."""
    count = int.from_bytes(data[HEADER - 4 : HEADER], "little")
    return count > 0 and len(data) == HEADER + count * FACE.itemsize


def _is_text(data: bytes) -> bool:
    """Whether the file is text: binary headers may begin with `solid` as well."""
    if not TEXT.match(data):
        return False
    return len(data) <= HEADER or KEYWORD.search(data[:BEGINNING]) is not None


def _mesh(corners: Float[ndarray, "f 3 3"], columns: dict[str, FaceColumn]) -> FileMesh:
    return FileMesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), columns=columns)


def _find_records(path: Path, data: bytes) -> ndarray:
    """Find the records of a binary file's faces, by its number of faces or, without one, by its length."""
    if len(data) < HEADER:
        raise InputError(f"{path} cannot be read as stl (truncated or damaged?): {len(data)} bytes; export it again")
    declared = int.from_bytes(data[HEADER - 4 : HEADER], "little")
    held, rest = divmod(len(data) - HEADER, FACE.itemsize)
    if declared in UNKNOWN and held and not rest:
        logger.warning("%s: declares %d faces, and holds %d, which are read", path, declared, held)
        declared = held
    elif declared > held:
        raise InputError(
            f"{path} cannot be read as stl: it is truncated, or none (it declares {declared} faces and holds {held}); "
            "export it again"
        )
    elif extra := len(data) - HEADER - declared * FACE.itemsize:
        if not declared:
            raise InputError(
                f"{path} cannot be read as stl: it declares no faces before {extra} bytes; export it again"
            )
        logger.warning("%s: %d bytes after its %d faces are left out", path, extra, declared)
    return np.frombuffer(data, FACE, declared, HEADER)


def number_colours(header: bytes, attributes: UInt16[ndarray, " f"]) -> Int[ndarray, " f"]:
    """Number the colours of faces, 5 bits a channel, in the order of their first appearance.

    Args:
        header: In which Magics writes `COLOR=`: then bit 15 is clear where a face has a colour of its own. Otherwise,
            as in VisCAM and SolidView, it is set there.
        attributes: Of the faces.
    """
    own = (attributes >> 15 == 0) if b"COLOR=" in header else (attributes >> 15 == 1)
    return number_names(np.where(own, (attributes & 0x7FFF).astype(np.int64), -1))


def _read_text(path: Path, data: bytes) -> FileMesh:
    """Read a text file; one without an end line is whole if its surface is closed."""
    facets = parse_facets(path, data)
    if len(facets.solids) and not facets.is_ended:
        if not _is_closed(facets.corners):
            raise InputError(
                f"{path} is truncated: no endsolid follows its {len(facets.corners)} facets, which do not close; "
                "export it again, or add the line endsolid"
            )
        logger.warning("%s: no endsolid follows its %d facets: further bodies may be missing", path, len(facets.solids))
    solids = number_names(facets.solids)
    return _mesh(facets.corners, {SOLID: FaceColumn(solids, are_ids=False)} if solids.any() else {})


def _is_closed(corners: Float[ndarray, "f 3 3"]) -> bool:
    """Whether each edge has an even number of faces, by position."""
    points = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)[1].reshape(-1, 3)
    return bool((edge_uses(points) % 2 == 0).all())
