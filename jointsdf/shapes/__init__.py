"""A shape's name or path -> Shape: the one door to every source of meshes and part labels."""

import hashlib
import logging
import re
from dataclasses import replace
from difflib import SequenceMatcher
from pathlib import Path

import numpy as np

from jointsdf.shapes import abc, builtin, file, repair
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
) -> Shape:
    """Load one shape with its part labels, in the file frame, with original label ids.

    Args:
        shape: A catalogue name (`part_01`, `abc_0001`) or the path of a ply, obj, stl, off or glb file.
        labels: A `.npy` file, `brep` (the patches as they are), `none`, or `auto`: `labels.npy`, else `patches.npy`
            beside the mesh. Given labels are never merged; the patches of a catalogue ABC shape are merged to at most
            18 parts under `auto`.
        abc_root: Folder that holds `abc_0001/mesh.ply` and so on.
        abc_missing: `fallback`: without the ABC mesh, go on with `part_01` and its own labels; `error`: do not.
        segmented: Whether at least two labelled parts are needed. If not, missing labels become -1.

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
        loaded = _from_path(Path(shape).expanduser(), labels, segmented)
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


def _from_path(path: Path, labels: str, segmented: bool) -> Shape:
    """The shape in a mesh file, named by stem and content."""
    found = file.read(path)
    source = part_labels.find(labels, path)
    if source is None:
        if segmented and labels == "brep":
            raise InputError(
                f"labels={labels}: {path.with_name('patches.npy')} not found; give labels=<file.npy>, or head=none"
            )
        per_face, provider = np.full(len(found.faces), UNLABELLED), "none"
    elif found.has_polygons:
        raise InputError(
            f"{path} has polygons, so labels per face are ambiguous: triangulate it, one label per triangle"
        )
    else:
        per_face, provider = part_labels.read(source[0], len(found.faces)), source[1]
    solid = repair.cleaned(str(path), found.vertices, found.faces)
    mesh = LabelledMesh(solid.vertices, solid.faces, per_face[solid.kept])
    stem = re.sub(r"[^A-Za-z0-9._-]", "_", path.stem).lstrip(".")[:100] or "mesh"
    return Shape(f"{stem}-{found.sha256[:6]}", mesh, found.sha256, provider, solid.watertight)
