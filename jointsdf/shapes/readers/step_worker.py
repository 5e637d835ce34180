"""Tessellation of a STEP file: read from standard input, triangles to standard output (.npz).

Run as a script, never imported: a damaged file can crash the CAD kernel, and with it the process that called it.
"""

import io
import os
import re
import sys
from typing import Any

import cascadio
import numpy as np
import trimesh

COARSE, COARSE_ANGLE = 1e6, 0.5  # mm, radians: enough to learn the size
MILLIMETRES = 1000.0  # per metre: the kernel takes tolerances in millimetres and gives positions in metres
STYLES = re.compile(rb"(STYLED_ITEM\s*\(\s*(?:(?:'[^']*')+\s*,\s*)?)\([^()]*\)")


def main(tol_linear: float, tol_angular: float) -> None:
    """Write `vertices` (m), `faces`, `patches` of the faces, `surfaces` of the patches.

    Writes nothing where the file holds no surface.

    Args:
        tol_linear: Largest distance from the surface, relative to the longest side of the whole file.
        tol_angular: Largest angle between neighbouring chords, radians.
    """
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # the kernel prints its complaints to standard output
    data = STYLES.sub(rb"\1()", sys.stdin.buffer.read())  # of a body in several colours only one keeps its face ids
    coarse = _load_scene(cascadio.load(data, "step", tol_linear=COARSE, tol_angular=COARSE_ANGLE))
    if not coarse.geometry:
        return
    tol_linear *= MILLIMETRES * float(coarse.extents.max())
    glb = cascadio.load(data, "step", tol_linear=tol_linear, tol_angular=tol_angular, include_brep=True)
    with output:
        np.savez(output, **_collect_arrays(_load_scene(glb)))


def _load_scene(glb: bytes) -> trimesh.Scene:
    """Load the kernel's answer, which has no bytes where it cannot read the file."""
    if not glb:
        return trimesh.Scene()
    scene = trimesh.load_scene(io.BytesIO(glb), file_type="glb", process=False)
    scene.delete_geometry([name for name, mesh in scene.geometry.items() if not isinstance(mesh, trimesh.Trimesh)])
    return scene


def _collect_arrays(scene: trimesh.Scene) -> dict[str, Any]:
    """Collect the triangles of every body in its place, patches numbered through all bodies."""
    vertices: list[np.ndarray] = []
    faces: list[np.ndarray] = []
    patches: list[np.ndarray] = []
    surfaces: list[str] = []
    count = 0
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        mesh = scene.geometry[name]
        if "brep_index" not in mesh.face_attributes:
            sys.exit(f"no B-rep face ids for body {name}: cascadio >= 0.1.1 and trimesh >= 4.11 give them")
        positions = np.asarray(mesh.vertices, dtype=np.float64)
        # Element by element: a matrix product may round equal positions apart, and the bodies would come open.
        x, y, z = (positions[:, [axis]] * matrix[:3, axis] for axis in range(3))
        vertices.append(x + y + z + matrix[:3, 3])
        mirrored = np.linalg.det(matrix[:3, :3]) < 0
        faces.append(np.asarray(mesh.faces, dtype=np.int64)[:, :: -1 if mirrored else 1] + count)
        index = np.asarray(mesh.face_attributes["brep_index"], dtype=np.int64)
        primitives = mesh.metadata["cascadio"]["brep_primitives"]
        known = [type(each).__name__.lower() if each else "other" for each in primitives]
        patches.append(index + len(surfaces))
        surfaces += known + ["other"] * (int(index.max()) + 1 - len(known))
        count += len(positions)
    return {
        "vertices": np.concatenate(vertices),
        "faces": np.concatenate(faces),
        "patches": np.concatenate(patches),
        "surfaces": np.array(surfaces),
    }


if __name__ == "__main__":
    main(float(sys.argv[1]), float(sys.argv[2]))
