"""Reader of mesh files of every format, as triangles in the file's order, which reports any damage."""

import hashlib
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from jointsdf.errors import InputError
from jointsdf.shapes.readers.content import Content, read_content, unpack
from jointsdf.shapes.readers.file_mesh import FileMesh, check_mesh
from jointsdf.shapes.readers.formats import format_of
from jointsdf.shapes.readers.gltf import read_gltf
from jointsdf.shapes.readers.gltf_container import open_container
from jointsdf.shapes.readers.obj import read_obj
from jointsdf.shapes.readers.off import read_off
from jointsdf.shapes.readers.ply import read_ply
from jointsdf.shapes.readers.precision import warn_of_rounding
from jointsdf.shapes.readers.stl import read_stl

READERS: Mapping[str, Callable[[Path, bytes], FileMesh]] = {
    "ply": read_ply,
    "obj": read_obj,
    "stl": read_stl,
    "off": read_off,
    "glb": read_gltf,
    "gltf": read_gltf,
}


def read_mesh(path: Path) -> FileMesh:
    """Read a mesh file without repairs.

    Args:
        path: A file of one of `READERS`' formats, compressed by gzip or not. Several meshes in one file are joined in
            the file's order.

    Raises:
        InputError: The file is missing, empty, truncated, unreadable or of another format, has no faces, a
            NaN or infinite vertex, or a face that uses a vertex out of range.
    """
    content = read_content(path)
    if content.format not in READERS:
        raise InputError(f"{path} is no mesh but a {content.format.upper()} file: give one of {', '.join(READERS)}")
    return parse_mesh(path, content)


def content_sha256(path: Path, stored: bytes) -> str:
    """Hash a shape's file, and of a `.gltf` the files beside it that belong to it.

    Args:
        path: The file, of any format.
        stored: Its bytes.
    """
    found = ""
    if format_of(path) == "gltf":
        with suppress(InputError, ValueError):  # reported by whoever reads it
            found = open_container(path, unpack(path, stored)).sha256
    return found or hashlib.sha256(stored).hexdigest()


def parse_mesh(path: Path, content: Content) -> FileMesh:
    """Parse the content of a mesh file, as `read_mesh`.

    Args:
        path: The file.
        content: Of a format of `READERS`.
    """
    mesh = READERS[content.format](path, content.data)
    check_mesh(str(path), mesh.vertices, mesh.faces)
    if content.format in ("glb", "gltf"):  # all of whose coordinates are of 32 bits
        warn_of_rounding(str(path), mesh.vertices)
    return mesh if mesh.sha256 else replace(mesh, sha256=content.sha256)
