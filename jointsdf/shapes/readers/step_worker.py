"""Tessellation of a STEP file: read from standard input, triangles to standard output (.npz).

Run as a script, never imported: a damaged file can crash the CAD kernel, and with it the process that called it.
"""

import io
import os
import re
import resource
import sys
from collections.abc import Iterator
from typing import Any

import cascadio
import numpy as np
import trimesh

COARSE, COARSE_ANGLE = 1e6, 0.5  # mm, radians: enough to learn the size
MILLIMETRES = 1000.0  # per metre: the kernel takes tolerances in millimetres and gives positions in metres
STYLES = re.compile(rb"(STYLED_ITEM\s*\(\s*(?:(?:'[^']*')+\s*,\s*)?)\([^()]*\)")
UNPAINTED = -1


def main(tolerance: float, angle: float) -> None:
    """Write `vertices` (m), `faces`; `patches`, `products` of the faces; `surfaces` of the patches.

    Also the largest `spacing` of the kernel's float32 coordinates (m) and, where the file has several, `colours` of the
    faces: 0xRRGGBB of linear components, one for each patch, -1 where none is given. Writes nothing where the file
    holds no surface.

    Args:
        tolerance: Largest distance from the surface, relative to the longest side of the whole file.
        angle: Largest angle between neighbouring chords, radians.
    """
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # the kernel prints its complaints to standard output
    styled = sys.stdin.buffer.read()
    plain = STYLES.sub(rb"\1()", styled)  # of a body in several colours only one keeps its face ids
    coarse = _tessellate(plain, COARSE, COARSE_ANGLE)
    if not coarse.geometry:
        return
    distance = tolerance * MILLIMETRES * float(coarse.extents.max())
    arrays = _collect_arrays(_tessellate(plain, distance, angle, include_brep=True))
    if styled != plain and len(set(map(_colour, _tessellate(styled, COARSE, COARSE_ANGLE).geometry.values()))) > 1:
        arrays["colours"] = _find_colours(_tessellate(styled, distance, angle), arrays)
    with output:
        np.savez(output, **arrays)


def _tessellate(data: bytes, distance: float, angle: float, **options: Any) -> trimesh.Scene:
    """Run the kernel; an empty scene where it cannot read the file, which it answers by no bytes.

    Args:
        data: The STEP file.
        distance: Largest distance from the surface, mm.
        angle: As for `main`.
        **options: Of the kernel.
    """
    glb = cascadio.load(data, "step", tol_linear=distance, tol_angular=angle, **options)
    if not glb:
        return trimesh.Scene()
    scene = trimesh.load_scene(io.BytesIO(glb), file_type="glb", process=False)
    scene.delete_geometry([name for name, mesh in scene.geometry.items() if not isinstance(mesh, trimesh.Trimesh)])
    return scene


def _place_meshes(scene: trimesh.Scene) -> Iterator[tuple[trimesh.Trimesh, np.ndarray, np.ndarray]]:
    """Each mesh of a scene with its vertices in their place, and its faces wound outward there."""
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        mesh = scene.geometry[name]
        positions = np.asarray(mesh.vertices, dtype=np.float64)
        # Element by element: a matrix product may round equal positions apart, and the bodies would come open.
        x, y, z = (positions[:, [axis]] * matrix[:3, axis] for axis in range(3))
        mirrored = np.linalg.det(matrix[:3, :3]) < 0
        faces = np.asarray(mesh.faces, dtype=np.int64)[:, :: -1 if mirrored else 1]
        yield mesh, x + y + z + matrix[:3, 3], faces


def _collect_arrays(scene: trimesh.Scene) -> dict[str, Any]:
    """Collect the triangles of every product in its place, patches numbered through all of them."""
    columns: dict[str, list[np.ndarray]] = {"vertices": [], "faces": [], "patches": [], "products": []}
    surfaces: list[str] = []
    count, spacing = 0, 0.0
    for product, (mesh, vertices, faces) in enumerate(_place_meshes(scene)):
        if "brep_index" not in mesh.face_attributes:
            sys.exit("no B-rep face ids in a body: cascadio >= 0.1.1 and trimesh >= 4.11 give them")
        index = np.asarray(mesh.face_attributes["brep_index"], dtype=np.int64)
        primitives = mesh.metadata["cascadio"]["brep_primitives"]
        known = [type(each).__name__.lower() if each else "other" for each in primitives]
        columns["vertices"].append(vertices)
        columns["faces"].append(faces + count)
        columns["patches"].append(index + len(surfaces))
        columns["products"].append(np.full(len(faces), product))
        surfaces += known + ["other"] * (int(index.max()) + 1 - len(known))
        count += len(vertices)
        spacing = max(spacing, float(np.spacing(np.abs(mesh.vertices).max().astype(np.float32))))
    arrays: dict[str, Any] = {name: np.concatenate(pieces) for name, pieces in columns.items()}
    return arrays | {"surfaces": np.array(surfaces), "spacing": np.float64(spacing)}


def _find_colours(scene: trimesh.Scene, arrays: dict[str, Any]) -> np.ndarray:
    """Find the colour of each face: that of most triangles of its patch, matched by their positions."""
    colours: dict[Any, Any] = {}
    for mesh, vertices, faces in _place_meshes(scene):
        colours |= dict.fromkeys(_triangle_keys(vertices, faces), _colour(mesh))
    found = np.array([colours.get(key, UNPAINTED) for key in _triangle_keys(arrays["vertices"], arrays["faces"])])
    names, index = np.unique(found, return_inverse=True)
    votes = np.zeros((len(arrays["surfaces"]), len(names)), dtype=np.int64)
    np.add.at(votes, (arrays["patches"], index), 1)
    return names[votes.argmax(axis=1)][arrays["patches"]]


def _triangle_keys(vertices: np.ndarray, faces: np.ndarray) -> list[bytes]:
    """A key for each triangle, equal for those of the same corners and side."""
    positions, index = np.unique(vertices + 0.0, axis=0, return_inverse=True)  # + 0.0: no negative zeros
    corners = index.reshape(-1)[faces]
    first = (corners.argmin(axis=1)[:, None] + np.arange(3)) % 3
    return [row.tobytes() for row in positions[np.take_along_axis(corners, first, axis=1)].reshape(len(faces), 9)]


def _colour(mesh: trimesh.Trimesh) -> int:
    """Colour of a mesh."""
    factor = getattr(getattr(mesh.visual, "material", None), "baseColorFactor", None)
    if factor is None:
        return UNPAINTED
    red, green, blue = (int(component) for component in factor[:3])
    return red << 16 | green << 8 | blue


if __name__ == "__main__":
    limit = int(sys.argv[3])
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    main(float(sys.argv[1]), float(sys.argv[2]))
