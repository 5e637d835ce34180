"""Conversion of a model's ABC files to `mesh.ply` and `patches.npy`, as the catalogue describes them."""

import hashlib
import io
import logging
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.geometry.ply import binary_ply
from jointsdf.geometry.topology import face_components
from jointsdf.runs.files import write_atomically
from jointsdf.shapes.abc import CatalogueEntry
from jointsdf.shapes.readers import step
from jointsdf.shapes.readers.abc_features import read_features
from jointsdf.shapes.readers.content import read_content
from jointsdf.shapes.readers.formats import format_of
from jointsdf.shapes.readers.mesh_file import read_mesh
from jointsdf.values import UNLABELLED

METRES = (0.001, 0.01, 0.0254, 0.3048, 1.0)  # per mm, cm, inch, foot, metre
CLOSE = 0.01  # relative difference of extents that another tessellation may make
STL_GRID = 1e-4  # millimetres within which the vertices of an STL file are one
NUMBERED = re.compile(r"component (\d+)")

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Surface:
    """A mesh before it is written.

    Attributes:
        vertices: Positions.
        faces: Vertex indices.
        patches: The B-rep patch of each face, None where none are known.
    """

    vertices: Float[ndarray, "v 3"]
    faces: Int[ndarray, "f 3"]
    patches: Int[ndarray, " f"] | None


def write_shape(entry: CatalogueEntry, paths: Sequence[Path], folder: Path) -> str:
    """Convert one model to `mesh.ply` and, where its patches are known, `patches.npy`.

    Args:
        entry: The catalogue's row.
        paths: Its mesh or STEP file, and the features file of an obj mesh.
        folder: The shape's folder. The mesh is written last, so that a shape with a mesh is complete.

    Returns:
        A summary for the user, one line.

    Raises:
        InputError: A file is damaged, or does not hold what the catalogue describes.
    """
    surface = read_surface(paths)
    if "component" in entry.geometry:
        surface = select_component(entry, surface, paths[0])
    factor = find_scale(entry, surface.vertices)
    if factor is None:
        sides = " ".join(f"{side:.6g}" for side in np.ptp(surface.vertices, axis=0))
        expected = " ".join(f"{side:g}" for side in entry.extents)
        logger.warning("%s: %s has sides %s, the catalogue says %s: not scaled", entry.name, paths[0], sides, expected)
        factor = 1.0
    surface = replace(surface, vertices=surface.vertices * factor)
    if format_of(paths[0]) == "stl":
        surface = _merge_vertices(surface)
    data = binary_ply(surface.vertices.astype("<f4"), surface.faces, {}, "ABC dataset model")
    folder.mkdir(parents=True, exist_ok=True)
    if surface.patches is None:
        (folder / "patches.npy").unlink(missing_ok=True)
    else:
        stream = io.BytesIO()
        np.save(stream, surface.patches.astype(np.int32))
        write_atomically(folder / "patches.npy", stream.getvalue())
    write_atomically(folder / "mesh.ply", data)
    return _summary(surface, paths[0], factor, hashlib.sha256(data).hexdigest() == entry.sha256)


def _summary(surface: Surface, path: Path, factor: float, is_same: bool) -> str:
    """Counts, source and scale of a converted mesh."""
    patches = "no patches" if surface.patches is None else f"{len(np.unique(surface.patches))} patches"
    scaled = "" if factor == 1 else f", times {factor:g}"
    same = "the catalogue's own mesh" if is_same else "another tessellation than the catalogue's"
    return f"{len(surface.vertices)} vertices, {len(surface.faces)} faces, {patches}, from {path.name}{scaled}: {same}"


def read_surface(paths: Sequence[Path]) -> Surface:
    """Read the files of one model, in the file's units."""
    mesh = paths[0]
    if format_of(mesh) == "step":
        solid = step.read_step(mesh, read_content(mesh).data)
        return Surface(solid.vertices, solid.faces, solid.patches)
    found = read_mesh(mesh)
    if len(paths) == 1:
        return Surface(found.vertices, found.faces, None)
    if found.has_polygons:
        raise InputError(f"{mesh} has polygons, ABC's own have triangles: it is not the mesh of {paths[1].name}")
    patches = read_features(paths[1], len(found.faces), len(found.vertices)).patches
    return Surface(found.vertices, found.faces, patches)


def select_component(entry: CatalogueEntry, surface: Surface, path: Path) -> Surface:
    """Select the connected component with the catalogue's extents; of several, the one with its number."""
    numbered = NUMBERED.search(entry.geometry) or NUMBERED.search(entry.abc_id)
    bodies = list(_split_components(surface))
    fitting = [number for number, body in enumerate(bodies) if find_scale(entry, body.vertices) is not None]
    if not fitting:
        sides = " ".join(f"{side:g}" for side in entry.extents)
        raise InputError(f"{path}: none of its {len(bodies)} components has the catalogue's sides, {sides}")
    number = int(numbered[1]) if numbered else -1
    return bodies[number if number in fitting else fitting[0]]


def _split_components(surface: Surface) -> Iterator[Surface]:
    """Split a mesh into its connected components, in the file's order, vertices and patches renumbered."""
    of_face = face_components(surface.faces)
    order = of_face[np.sort(np.unique(of_face, return_index=True)[1])]
    for each in order:
        mine = of_face == each
        used, faces = np.unique(surface.faces[mine], return_inverse=True)
        patches = None if surface.patches is None else surface.patches[mine]
        if patches is not None:
            known = np.unique(patches[patches != UNLABELLED])
            patches = np.where(patches == UNLABELLED, UNLABELLED, np.searchsorted(known, patches))
        yield Surface(surface.vertices[used], faces.reshape(-1, 3), patches)


def find_scale(entry: CatalogueEntry, vertices: Float[ndarray, "v 3"]) -> float | None:
    """Find the factor from the mesh's unit to the catalogue's by the extents; None where it is no change of unit.

    The catalogue's mesh of a normalised model has no unit: there any factor is accepted.
    """
    sides = np.ptp(vertices, axis=0)
    if not (sides > 0).all():
        return None
    ratios = np.array(entry.extents) / sides
    if "normalised" in entry.geometry:
        middle = float(np.median(ratios))
        return middle if np.allclose(ratios, middle, rtol=CLOSE) else None
    units = {round(one / other, 9) for one in METRES for other in METRES}
    return next((unit for unit in sorted(units) if np.allclose(ratios, unit, rtol=CLOSE, atol=0)), None)


def _merge_vertices(surface: Surface) -> Surface:
    """Merge vertices by position: an STL file repeats each at every face."""
    cells = np.round(surface.vertices / STL_GRID).astype(np.int64)
    _, first, index = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    return replace(surface, vertices=surface.vertices[first], faces=index.reshape(-1)[surface.faces])
