"""Primitives of a glTF mesh as triangles with a colour each.

Format: Khronos, "glTF 2.0 Specification", section 3.7 (meshes), 3.9 (materials).
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.geometry.mesh import used_vertices
from jointsdf.shapes.readers.face_columns import majority
from jointsdf.shapes.readers.gltf_accessors import read_accessor, read_indices, refuse_compression
from jointsdf.shapes.readers.gltf_container import Container
from jointsdf.shapes.readers.gltf_json import Json, integer, name_of, nested, numbers, pick

TRIANGLES, STRIP, FAN = 4, 5, 6  # values of a primitive's mode
WHITE = (1.0, 1.0, 1.0, 1.0)


class Primitive(NamedTuple):
    """Triangles of one material.

    Attributes:
        positions: Those that a triangle uses, in the mesh's frame.
        triangles: Indices of positions.
        colours: Linear red, green and blue of each triangle: the material's, times that of most of its corners.
        material: Name of the material, or its number where it has no name; "" without one.
        is_coloured: Whether the file gives it a material or colours.
    """

    positions: Float[ndarray, "v 3"]
    triangles: Int[ndarray, "f 3"]
    colours: Float[ndarray, "f 3"]
    material: str
    is_coloured: bool


def read_primitive(source: str, file: Container, primitive: Json) -> Primitive | None:
    """Read a primitive; None for points, lines, and those without positions.

    Args:
        source: Names the file in messages.
        file: The file.
        primitive: Of one of its meshes.

    Raises:
        InputError: It is compressed.
        ValueError: It is damaged; the message says where.
    """
    attributes, mode = nested(primitive, "attributes"), integer(primitive, "mode", TRIANGLES)
    if mode not in (TRIANGLES, STRIP, FAN) or "POSITION" not in attributes:
        return None
    for accessor in (attributes["POSITION"], *([primitive["indices"]] if "indices" in primitive else [])):
        refuse_compression(source, file, accessor)
    positions = read_accessor(file, attributes["POSITION"], ("VEC3",))
    count = len(positions)
    order = read_indices(file, primitive["indices"], count) if "indices" in primitive else np.arange(count)
    used, triangles = used_vertices(cut_into_triangles(order, mode), count)
    colours = np.ones((len(triangles), 3))
    if "COLOR_0" in attributes:
        colours = _colours_of_most_corners(file, attributes["COLOR_0"], used, triangles)
    material = ""
    if "material" in primitive:
        look = pick(file.document, "materials", primitive["material"])
        material = name_of(look) or f"number {primitive['material']}"
        colours = colours * numbers(nested(look, "pbrMetallicRoughness"), "baseColorFactor", WHITE)[:3]
    is_coloured = "COLOR_0" in attributes or "material" in primitive
    return Primitive(positions[used].astype(np.float64), triangles, colours, material, is_coloured)


def cut_into_triangles(order: Int[ndarray, " n"], mode: int) -> Int[ndarray, "f 3"]:
    """Cut the vertices of a primitive into triangles, a strip's without those that only lead from row to row.

    Args:
        order: Vertices in the order of drawing.
        mode: Triangles, strip or fan.

    Raises:
        ValueError: The vertices are no whole number of triangles.
    """
    if mode == TRIANGLES:
        if len(order) % 3:
            raise ValueError(f"{len(order)} corners are no whole number of triangles")
        return order.reshape(-1, 3)
    at = np.arange(max(len(order) - 2, 0))
    if mode == FAN:
        return order[np.stack([at + 1, at + 2, np.zeros_like(at)], axis=1)]
    found = order[np.stack([at, at + 1 + at % 2, at + 2 - at % 2], axis=1)]
    return found[(found != np.roll(found, 1, axis=1)).all(axis=1)]


def _colours_of_most_corners(
    file: Container, accessor: object, used: ndarray, triangles: Int[ndarray, "f 3"]
) -> Float[ndarray, "f 3"]:
    """Colour of most corners of each triangle."""
    colours = read_accessor(file, accessor, ("VEC3", "VEC4"))
    if len(colours) != len(used):
        raise ValueError(f"{len(colours)} colours are given for {len(used)} vertices")
    distinct, index = np.unique(colours[used][:, :3].astype(np.float64), axis=0, return_inverse=True)
    return distinct[majority(index.reshape(-1), triangles)]
