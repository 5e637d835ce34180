"""A shape's name or path -> Shape: the one door to every source of meshes and part labels."""

import hashlib
import logging
import re
from dataclasses import dataclass, replace
from difflib import SequenceMatcher
from pathlib import Path

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from jointsdf.errors import InputError, require_integer
from jointsdf.shapes import abc, builtin
from jointsdf.shapes.labels.partfield import names as partfield_names
from jointsdf.shapes.labels.providers import UnlabelledShape, benchmark, provide
from jointsdf.shapes.readers import abc_features as features
from jointsdf.shapes.readers import mesh_file as file
from jointsdf.shapes.readers import step
from jointsdf.shapes.repair import repair_mesh
from jointsdf.values import UNLABELLED, LabelledMesh, Shape

FALLBACK = "part_01"
ABC_MISSING = ("fallback", "error")

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class LabelRequest:
    """Which part labels a user asked for.

    Attributes:
        labels: A provider's name or the path of a label file.
        num_parts: Number of parts, None where the provider is to choose.
        partfield_dir: PartField's output folder.
        needed: Whether a shape without parts is of no use.

    Raises:
        InputError: Fewer than two parts.
    """

    labels: str = "auto"
    num_parts: int | None = None
    partfield_dir: Path | None = None
    needed: bool = True

    def __post_init__(self) -> None:
        """Check the number of parts."""
        if self.num_parts is not None:
            require_integer("num_parts", self.num_parts, 2)


def shape_names() -> list[str]:
    """Every name that `load` knows: the built-in parts, then the ABC catalogue."""
    return [*builtin.part_names(), *abc.catalogue()]


def name_of(shape: str, *, abc_root: str | Path, abc_missing: str) -> str:
    """The name that rows and folders give a shape, without loading it: its own, or a mesh file's stem and content.

    Args:
        shape: As for `load`; need not be there.
        abc_root: As for `load`.
        abc_missing: As for `load`.
    """
    if shape in abc.catalogue():
        fallback = abc_missing == "fallback" and not abc.mesh_path(shape, abc_root).is_file()
        return FALLBACK if fallback else shape
    path = Path(shape).expanduser()
    if shape in builtin.BUILTINS or not path.is_file():
        return _stem(path)
    return f"{_stem(path)}-{hashlib.sha256(path.read_bytes()).hexdigest()[:6]}"


def load(
    shape: str,
    *,
    labels: str = "auto",
    num_parts: int | None = None,
    partfield_dir: str | Path | None = None,
    abc_root: str | Path,
    abc_missing: str = "fallback",
    segmented: bool = True,
    step_tolerance: float = 1e-4,
    step_angle: float = 0.1,
) -> Shape:
    """Load one shape with its part labels, in the file frame, with original label ids.

    Args:
        shape: A catalogue name (`part_01`, `abc_0001`) or the path of a ply, obj, stl, off, glb, step or stp file.
        labels: A label file (`.npy`, `.txt`, ABC features, or a PLY with face labels or colours), or a provider:
            `auto` (a built-in part's own, `labels.npy` beside the mesh, else `geometric`), `geometric`, `partfield`,
            `brep` or `none`. The B-rep patches are a STEP file's faces, those of the features file beside an ABC obj,
            or `patches.npy` beside the mesh.
        num_parts: Number of parts, >= 2, for a provider that can choose. None: the benchmark's number for a catalogue
            ABC shape, the natural one for any other.
        partfield_dir: PartField's output folder, for `labels=partfield`.
        abc_root: Folder that holds `abc_0001/mesh.ply` and so on.
        abc_missing: `fallback`: without the ABC mesh, go on with `part_01` and its own labels; `error`: do not.
        segmented: Whether at least two labelled parts are needed.
        step_tolerance: Largest distance of a STEP file's triangles from its surfaces, relative to its longest side.
        step_angle: Largest angle between neighbouring chords of a STEP file's curves, radians.

    Raises:
        InputError: The name, path, mesh or label file cannot be used, or a segmentation has nothing to learn.
    """
    if abc_missing not in ABC_MISSING:
        raise InputError(f"unknown abc_missing={abc_missing!r}: give one of {', '.join(ABC_MISSING)}")
    folder = None if partfield_dir is None else Path(partfield_dir).expanduser()
    request = LabelRequest(labels, num_parts, folder, segmented)
    if shape in builtin.BUILTINS:
        loaded = _built(shape, request)
    elif shape in abc.catalogue():
        loaded = _from_catalogue(shape, request, abc_root, abc_missing)
    elif Path(shape).suffix or "/" in shape or "\\" in shape or Path(shape).is_file():
        loaded = _from_path(
            Path(shape).expanduser(), request, tessellation=step.Tessellation(step_tolerance, step_angle)
        )
    else:
        near = sorted(shape_names(), key=lambda name: -SequenceMatcher(None, name, shape).ratio())[:4]
        raise InputError(f"unknown shape {shape!r}: near names are {', '.join(near)}; or give the path of a mesh file")
    if segmented:
        require_parts(loaded)
    return loaded


def require_parts(shape: Shape) -> None:
    """Refuse a shape that a segmentation has nothing to learn from.

    Raises:
        InputError: It has fewer than two labelled parts.
    """
    if len(shape.mesh.part_ids) < 2:
        found = "no part labels" if len(shape.mesh.part_ids) == 0 else "only one part"
        raise InputError(f"{shape.name} has {found}: give labels=<file.npy>, or head=none to fit it without parts")


def _built(name: str, request: LabelRequest) -> Shape:
    """A built-in part, with its own labels unless others are asked for."""
    mesh = builtin.BUILTINS[name]()
    digest = hashlib.sha256(mesh.vertices.tobytes() + mesh.faces.tobytes()).hexdigest()
    if request.labels == "brep":
        raise InputError(f"labels=brep is for mesh files: the built-in {name} has its own labels, labels=auto")
    subject = UnlabelledShape(
        name,
        file.FileMesh(mesh.vertices, mesh.faces, False, digest),
        mesh,
        np.arange(len(mesh.faces)),
        known_as=(name,),
        num_parts=request.num_parts,
        partfield_dir=request.partfield_dir,
    )
    labels, provider = provide(request.labels, subject)
    return Shape(name, replace(mesh, labels=labels), digest, provider, watertight=True)


def _from_catalogue(name: str, request: LabelRequest, root: str | Path, missing: str) -> Shape:
    """A catalogue ABC shape, or the fallback part under its own name where the mesh is not there."""
    entry, path = abc.catalogue()[name], abc.mesh_path(name, root)
    if not path.is_file():
        how = abc.how_to_get(entry, path)
        if missing == "error":
            raise InputError(how)
        logger.warning("%s. Going on with the built-in %s and its own labels.", how, FALLBACK)
        return _built(FALLBACK, LabelRequest())
    shape = _from_path(path, request, name)
    if shape.mesh_sha256 != entry.sha256:
        logger.warning("%s is not the catalogue's mesh: sha256 %s, expected %s", path, shape.mesh_sha256, entry.sha256)
    return shape


def _from_path(
    path: Path, request: LabelRequest, name: str = "", tessellation: step.Tessellation = step.AS_USUAL
) -> Shape:
    """The shape in a mesh or STEP file, under its catalogue name, or named by stem and content."""
    found, brep_faces = triangles(path, tessellation)
    solid = repair_mesh(str(path), found.vertices, found.faces)
    unlabelled = LabelledMesh(solid.vertices, solid.faces, np.full(len(solid.faces), UNLABELLED))
    subject = UnlabelledShape(
        str(path),
        found,
        unlabelled,
        solid.kept,
        beside=path.with_name("labels.npy"),
        patch_source=path if brep_faces is not None else features.beside(path) or path.with_name("patches.npy"),
        patches=brep_faces,
        known_as=(*((name,) if name else ()), *partfield_names(path, found.sha256)),
        num_parts=request.num_parts,
        usual_parts=benchmark().get(name),
        partfield_dir=request.partfield_dir,
        needed=request.needed,
    )
    labels, provider = provide(request.labels, subject)
    return Shape(
        name or f"{_stem(path)}-{found.sha256[:6]}",
        replace(unlabelled, labels=labels),
        found.sha256,
        provider,
        solid.watertight,
        flipped=solid.flipped,
        dropped=len(found.faces) - len(solid.faces),
    )


def _stem(path: Path) -> str:
    return re.sub(r"[^A-Za-z0-9._-]", "_", path.stem).lstrip(".")[:100] or "mesh"


def triangles(
    path: Path, tessellation: step.Tessellation = step.AS_USUAL
) -> tuple[file.FileMesh, Int[ndarray, " f"] | None]:
    """The triangles that label files of a mesh or STEP file follow, and the B-rep face of each of a STEP file's.

    Raises:
        InputError: The file cannot be read.
    """
    if path.suffix.lower() not in step.SUFFIXES:
        return file.read(path), None
    data = file.content(path)
    mesh = step.read(path, data, tessellation)
    return file.FileMesh(mesh.vertices, mesh.faces, False, hashlib.sha256(data).hexdigest()), mesh.patches
