"""Loading of a shape by its name or path, with part labels from any source."""

import hashlib
import logging
from dataclasses import dataclass, replace
from difflib import SequenceMatcher
from pathlib import Path

import numpy as np

from jointsdf.errors import InputError, require_integer
from jointsdf.shapes import abc, builtin
from jointsdf.shapes.labels.partfield import possible_names
from jointsdf.shapes.labels.providers import benchmark, provide
from jointsdf.shapes.labels.unlabelled import UnlabelledShape
from jointsdf.shapes.naming import FALLBACK, name_of_file, shape_names
from jointsdf.shapes.readers import step
from jointsdf.shapes.readers.abc_features import find_features_file
from jointsdf.shapes.readers.file_mesh import FileMesh
from jointsdf.shapes.readers.triangles import read_triangles
from jointsdf.shapes.repair import repair_mesh
from jointsdf.shapes.units import AUTO, choose_unit
from jointsdf.user_paths import expand_home
from jointsdf.values import ASSUMED_UNIT, UNLABELLED, LabelledMesh, Shape, Subject

ABC_MISSING = ("fallback", "error")
SUGGESTIONS = 4  # near names in the message about an unknown one

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class LabelRequest:
    """Part labels that the user wants.

    Attributes:
        labels: A provider's name, the path of a label file, or `<mesh file>:<column>`.
        num_parts: Number of parts, None to let the provider choose.
        partfield_dir: PartField's output folder.
        needed: Whether a shape without parts is an error.

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
    unit: str = AUTO,
) -> Shape:
    """Load one shape with its part labels, in the file frame, with original label ids.

    Args:
        shape: A catalogue name (`part_01`, `abc_0001`) or the path of a ply, obj, stl, off, glb, gltf, step,
            stp or p21 file, compressed by gzip (.gz) or not.
        labels: A label file, a mesh file with labels, `<mesh file>:<column>` for one column of its faces, or a
            provider: `auto` (a built-in part's own, those in the mesh file, `labels.npy` beside it, else `geometric`),
            `geometric`, `partfield`, `brep` or `none`. The B-rep patches are a STEP file's faces, those of the features
            file beside an ABC obj, or `patches.npy` beside the mesh.
        num_parts: Number of parts, >= 2, for a provider that can choose. None: the benchmark's number for a catalogue
            ABC shape, the natural one for any other.
        partfield_dir: PartField's output folder, for `labels=partfield`.
        abc_root: Folder that holds `abc_0001/mesh.ply` and so on.
        abc_missing: Without the ABC mesh, `fallback` loads `part_01` with its own labels, `error` raises.
        segmented: Whether at least two labelled parts are needed.
        step_tolerance: Largest distance of a STEP file's triangles from its surfaces, relative to its longest side.
        step_angle: Largest angle between neighbouring chords of a STEP file's curves, radians.
        unit: Length unit of a file that names none: mm, cm, m, um, in or ft. `auto`: the file's own, else mm.

    Raises:
        InputError: The name, path, mesh or label file cannot be used, or a segmentation has nothing to learn.
    """
    if abc_missing not in ABC_MISSING:
        raise InputError(f"unknown abc_missing={abc_missing!r}: give one of {', '.join(ABC_MISSING)}")
    folder = None if partfield_dir is None else Path(expand_home(str(partfield_dir)))
    request = LabelRequest(labels, num_parts, folder, segmented)
    if shape in builtin.BUILTINS:
        loaded = _load_builtin(shape, request)
    elif shape in abc.catalogue():
        loaded = _load_from_catalogue(shape, request, abc_root, abc_missing)
    elif Path(shape).suffix or "/" in shape or "\\" in shape or Path(shape).is_file():
        path = Path(expand_home(shape))
        loaded = _load_file(path, request, tessellation=step.Tessellation(step_tolerance, step_angle))
    else:
        near = sorted(shape_names(), key=lambda name: -SequenceMatcher(None, name, shape).ratio())[:SUGGESTIONS]
        raise InputError(f"unknown shape {shape!r}: near names are {', '.join(near)}; or give the path of a mesh file")
    if segmented:
        require_parts(loaded)
    return replace(loaded, unit=choose_unit(shape, loaded.unit, unit))


def require_parts(shape: Subject) -> None:
    """Refuse a shape that a segmentation has nothing to learn from.

    Raises:
        InputError: It has fewer than two labelled parts.
    """
    if len(shape.part_ids) < 2:
        found = "no part labels" if len(shape.part_ids) == 0 else "only one part"
        raise InputError(f"{shape.name} has {found}: give labels=<file.npy>, or head=none to fit it without parts")


def _load_builtin(name: str, request: LabelRequest) -> Shape:
    """Build a part made by code, with its own labels unless others are wanted."""
    mesh = builtin.BUILTINS[name]()
    digest = hashlib.sha256(mesh.vertices.tobytes() + mesh.faces.tobytes()).hexdigest()
    if request.labels == "brep":
        raise InputError(f"labels=brep is for mesh files: the built-in {name} has its own labels, labels=auto")
    subject = UnlabelledShape(
        name,
        FileMesh(mesh.vertices, mesh.faces, digest),
        mesh,
        np.arange(len(mesh.faces)),
        known_as=(name,),
        num_parts=request.num_parts,
        partfield_dir=request.partfield_dir,
    )
    labels, provider = provide(request.labels, subject)
    return Shape(name, replace(mesh, labels=labels), digest, provider, watertight=True)


def _load_from_catalogue(name: str, request: LabelRequest, root: str | Path, missing: str) -> Shape:
    """Load a catalogue ABC shape, or the fallback part under its own name where there is no mesh."""
    entry, path = abc.catalogue()[name], abc.mesh_path(name, root)
    if not path.is_file():
        advice = abc.how_to_get(entry, path)
        if missing == "error":
            raise InputError(advice)
        logger.warning("%s. Loading the built-in %s with its own labels instead.", advice, FALLBACK)
        return _load_builtin(FALLBACK, LabelRequest())
    shape = _load_file(path, request, name)
    if shape.mesh_sha256 != entry.sha256:
        logger.warning("%s is not the catalogue's mesh: sha256 %s, expected %s", path, shape.mesh_sha256, entry.sha256)
    return shape


def _load_file(
    path: Path, request: LabelRequest, name: str = "", tessellation: step.Tessellation = step.DEFAULT
) -> Shape:
    """Load the shape in a mesh or STEP file, under its catalogue name, or named by stem and content."""
    found, brep_faces = read_triangles(path, tessellation)
    solid = repair_mesh(str(path), found.vertices, found.faces)
    unlabelled = LabelledMesh(solid.vertices, solid.faces, np.full(len(solid.faces), UNLABELLED))
    subject = UnlabelledShape(
        str(path),
        found,
        unlabelled,
        solid.source_faces,
        path=path,
        patch_source=path if brep_faces is not None else find_features_file(path) or path.with_name("patches.npy"),
        patches=brep_faces,
        known_as=(*((name,) if name else ()), *possible_names(path, found.sha256)),
        num_parts=request.num_parts,
        usual_parts=benchmark().get(name),
        partfield_dir=request.partfield_dir,
        needed=request.needed,
    )
    labels, provider = provide(request.labels, subject)
    return Shape(
        name or name_of_file(path, found.sha256),
        replace(unlabelled, labels=labels),
        found.sha256,
        provider,
        solid.watertight,
        flipped=solid.flipped,
        dropped=len(found.faces) - len(solid.faces),
        unit=found.unit or ASSUMED_UNIT,
        folded=solid.folded,
        welded=solid.welded,
        up=found.up,
    )
