"""A shape's name or path -> Shape: the one door to every source of meshes and part labels."""

import hashlib
import logging
import re
from dataclasses import replace
from difflib import SequenceMatcher
from pathlib import Path

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from jointsdf.shapes import abc, builtin, features, file, repair, step
from jointsdf.shapes import labels as part_labels
from jointsdf.values import UNLABELLED, InputError, LabelledMesh, Shape

FALLBACK = "part_01"
ABC_MISSING = ("fallback", "error")
MOST_PARTS = 18

logger = logging.getLogger(__name__)


def shape_names() -> list[str]:
    """Every name that `load` knows: the built-in parts, then the ABC catalogue."""
    return [*builtin.part_names(), *abc.catalogue()]


def load(
    shape: str,
    *,
    labels: str = "auto",
    abc_root: str | Path,
    abc_missing: str = "fallback",
    segmented: bool = True,
    step_tolerance: float = 1e-4,
    step_angle: float = 0.1,
) -> Shape:
    """Load one shape with its part labels, in the file frame, with original label ids.

    Args:
        shape: A catalogue name (`part_01`, `abc_0001`) or the path of a ply, obj, stl, off, glb, step or stp file.
        labels: A `.npy` or ABC features file, `brep` (the patches as they are), `none`, or `auto`: `labels.npy` beside
            the mesh, else the patches. These are a STEP file's B-rep faces, those of the features file beside an ABC
            obj, or `patches.npy` beside the mesh. Given labels are never merged; the patches of a catalogue ABC shape
            are merged to at most 18 parts under `auto`.
        abc_root: Folder that holds `abc_0001/mesh.ply` and so on.
        abc_missing: `fallback`: without the ABC mesh, go on with `part_01` and its own labels; `error`: do not.
        segmented: Whether at least two labelled parts are needed. If not, missing labels become -1.
        step_tolerance: Largest distance of a STEP file's triangles from its surfaces, relative to its longest side.
        step_angle: Largest angle between neighbouring chords of a STEP file's curves, radians.

    Raises:
        InputError: The name, path, mesh or label file cannot be used, or a segmentation has nothing to learn.
    """
    if abc_missing not in ABC_MISSING:
        raise InputError(f"unknown abc_missing={abc_missing!r}: give one of {', '.join(ABC_MISSING)}")
    if shape in builtin.BUILTINS:
        loaded = _built(shape, labels)
    elif shape in abc.catalogue():
        loaded = _from_catalogue(shape, labels, abc_root, abc_missing, segmented)
    elif Path(shape).suffix or "/" in shape or "\\" in shape or Path(shape).is_file():
        loaded = _from_path(Path(shape).expanduser(), labels, segmented, (step_tolerance, step_angle))
    else:
        near = sorted(shape_names(), key=lambda name: -SequenceMatcher(None, name, shape).ratio())[:4]
        raise InputError(f"unknown shape {shape!r}: near names are {', '.join(near)}; or give the path of a mesh file")
    if segmented and len(loaded.mesh.part_ids) < 2:
        found = "no part labels" if len(loaded.mesh.part_ids) == 0 else "only one part"
        raise InputError(f"{loaded.name} has {found}: give labels=<file.npy>, or head=none to fit it without parts")
    return loaded


def _built(name: str, labels: str) -> Shape:
    """A built-in part, with its own labels unless a file gives others."""
    mesh = builtin.BUILTINS[name]()
    if labels == "auto":
        mesh, provider = replace(mesh, labels=part_labels.numbered_by_area(mesh)), "builtin"
    elif labels == "none":
        mesh, provider = replace(mesh, labels=np.full(len(mesh.faces), UNLABELLED)), "none"
    elif labels in part_labels.PROVIDERS:
        raise InputError(f"labels={labels} is for mesh files: the built-in {name} has its own labels, labels=auto")
    else:
        path, provider = part_labels.named_file(labels)
        mesh = replace(mesh, labels=part_labels.read(path, len(mesh.faces)))
    digest = hashlib.sha256(mesh.vertices.tobytes() + mesh.faces.tobytes()).hexdigest()
    return Shape(name, mesh, digest, provider, watertight=True)


def _from_catalogue(name: str, labels: str, root: str | Path, missing: str, segmented: bool) -> Shape:
    """A catalogue ABC shape, or the fallback part under its own name where the mesh is not there."""
    entry, path = abc.catalogue()[name], abc.mesh_path(name, root)
    if not path.is_file():
        how = abc.how_to_get(entry, path)
        if missing == "error":
            raise InputError(how)
        logger.warning("%s. Going on with the built-in %s and its own labels.", how, FALLBACK)
        return _built(FALLBACK, "auto")
    shape = replace(_from_path(path, labels, segmented), name=name)
    if shape.mesh_sha256 != entry.sha256:
        logger.warning("%s is not the catalogue's mesh: sha256 %s, expected %s", path, shape.mesh_sha256, entry.sha256)
    if labels == "auto" and shape.label_provider == "brep":
        merged = part_labels.merged(shape.mesh, MOST_PARTS)
        shape = replace(shape, mesh=replace(shape.mesh, labels=merged), label_provider=f"brep:merged<={MOST_PARTS}")
    return shape


def _from_path(path: Path, labels: str, segmented: bool, tolerances: tuple[float, float] = (1e-4, 0.1)) -> Shape:
    """The shape in a mesh or STEP file, named by stem and content."""
    is_step = path.suffix.lower() in step.SUFFIXES
    found, brep_faces = _tessellated(path, *tolerances) if is_step else (file.read(path), None)
    patches = path if is_step else features.beside(path) or path.with_name("patches.npy")
    source = part_labels.find(labels, path, patches)
    if source is None:
        if segmented and labels == "brep":
            raise InputError(f"labels={labels}: {patches} not found; give labels=<file.npy>, or head=none")
        per_face, provider = np.full(len(found.faces), UNLABELLED), "none"
    elif found.has_polygons:
        raise InputError(
            f"{path} has polygons, so labels per face are ambiguous: triangulate it, one label per triangle"
        )
    elif brep_faces is not None and source[0] == path:
        per_face, provider = brep_faces, source[1]
    elif source[0].suffix.lower() in features.SUFFIXES:
        per_face, provider = features.read(source[0], len(found.faces), len(found.vertices)).patches, source[1]
    else:
        per_face, provider = part_labels.read(source[0], len(found.faces)), source[1]
    solid = repair.cleaned(str(path), found.vertices, found.faces)
    mesh = LabelledMesh(solid.vertices, solid.faces, per_face[solid.kept])
    stem = re.sub(r"[^A-Za-z0-9._-]", "_", path.stem).lstrip(".")[:100] or "mesh"
    return Shape(f"{stem}-{found.sha256[:6]}", mesh, found.sha256, provider, solid.watertight)


def _tessellated(path: Path, tolerance: float, angle: float) -> tuple[file.FileMesh, Int[ndarray, " f"]]:
    """A STEP file's triangles, as if they were a mesh file's, and the B-rep face of each."""
    data = file.content(path)
    mesh = step.read(path, data, tol_linear=tolerance, tol_angular=angle)
    return file.FileMesh(mesh.vertices, mesh.faces, False, hashlib.sha256(data).hexdigest()), mesh.patches
