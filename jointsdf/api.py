"""The library's face: load a shape, fit a field, load a fitted one.

>>> import jointsdf
>>> shape = jointsdf.load_shape("part_01")
>>> shape.name, len(shape.mesh.part_ids)
('part_01', 6)
"""

import logging
import os
import signal
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import trimesh
from hydra import compose, initialize_config_module
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from jointsdf import shapes
from jointsdf.cli_logging import Lines, library_logs_quiet
from jointsdf.errors import InputError, first_line, require_one_of
from jointsdf.experiment import build
from jointsdf.experiment.help import choices
from jointsdf.experiment.run import Outcome, Stopwatch, fit_shape, process_settings
from jointsdf.model.field import JointField
from jointsdf.phases import no_progress
from jointsdf.runs.files import write_atomically
from jointsdf.runs.folder import FIELD
from jointsdf.runs.row import ResultRow
from jointsdf.shapes.arrays import from_arrays
from jointsdf.shapes.readers.mesh_file import read_labelled_ply
from jointsdf.threads import large_pieces
from jointsdf.values import LabelledMesh, Shape
from jointsdf.viewing.export import glb_bytes, ply_bytes

FORMATS = ("ply", "glb", "obj", "stl", "off")


class PartMesh(LabelledMesh):
    """A part-labelled triangle mesh that can be written to a file."""

    def export(self, path: str | Path) -> Path:
        """Write the mesh: ply (part colours, `label` per face) and glb (a node per part) keep the parts.

        Args:
            path: Ends in ply, glb, obj, stl or off; its folder is made where it is not there.

        Raises:
            InputError: Another ending, or an empty mesh.
            OSError: The file cannot be written.
        """
        path = Path(path)
        kind = path.suffix.lower().lstrip(".")
        if kind not in FORMATS:
            raise InputError(f"{path}: format {kind or 'without suffix'} is not written; use {', '.join(FORMATS)}")
        if self.is_empty:
            raise InputError(f"{path}: the mesh is empty, the field has no surface in the training box")
        if kind in ("ply", "glb"):
            content = ply_bytes(self) if kind == "ply" else glb_bytes(self)
        else:
            exported = trimesh.Trimesh(self.vertices, self.faces, process=False).export(file_type=kind)
            content = exported if isinstance(exported, bytes) else str(exported).encode()
        write_atomically(path, content)
        return path


@dataclass(frozen=True)
class FittedRun:
    """What `fit` gives.

    Attributes:
        field: The fitted field; `field.query(points)` in file units.
        mesh: The extracted mesh, file frame, one part id per face.
        scores: Metrics of the primary protocol, by name, e.g. `cd_l1`; all protocols are in `row.scores`.
        row: The result row: scores, seconds, sizes, provenance.
        folder: The run folder; None where `out` was not given.
    """

    field: JointField
    mesh: PartMesh
    scores: dict[str, float]
    row: ResultRow
    folder: Path | None


def load_shape(
    source: str | Path | None = None,
    *,
    vertices: Any = None,
    faces: Any = None,
    labels: Any = "auto",
    num_parts: int | None = None,
    partfield_dir: str | Path | None = None,
    abc_root: str | Path | None = None,
    name: str | None = None,
) -> Shape:
    """Load a ground truth with its part labels, in its own units.

    Args:
        source: A catalogue name (`part_01`, `abc_0001`) or the path of a ply, obj, stl, off, glb, step or stp file.
        vertices: Positions, shape (v, 3), instead of `source`.
        faces: Vertex indices of triangles, shape (f, 3), with `vertices`.
        labels: `auto` (the shape's own, else geometric segmentation), `geometric`, `brep`, `partfield`, `none`, a label
            file; or with arrays one integer per face.
        num_parts: Number of parts, for a provider that can choose.
        partfield_dir: PartField's output folder, for `labels="partfield"`.
        abc_root: Folder of the ABC shapes; `$JOINTSDF_ABC`, else `data/abc`.
        name: Names a shape of arrays.

    Raises:
        InputError: The shape or its labels cannot be used. One line: the value and the fix.

    >>> load_shape("part_01", labels="none").mesh.part_ids.tolist()
    []
    """
    if (source is None) == (vertices is None):
        raise InputError("load_shape: give a name or a path, or else vertices= and faces=")
    folder = None if partfield_dir is None else Path(partfield_dir).expanduser()
    if source is None:
        if faces is None:
            raise InputError("load_shape: vertices= without faces=; give the triangles' vertex indices, shape (f, 3)")
        return from_arrays(vertices, faces, labels=labels, num_parts=num_parts, partfield_dir=folder, name=name)
    if not isinstance(labels, str | Path):
        raise InputError(
            "load_shape: labels= of a name or a path is a provider or a label file; arrays go with vertices="
        )
    return shapes.load(
        str(source),
        labels=str(labels),
        num_parts=num_parts,
        partfield_dir=folder,
        abc_root=abc_root or os.environ.get("JOINTSDF_ABC", "data/abc"),
        abc_missing="error",
        segmented=False,
    )


def fit(
    shape: Shape | str | Path,
    *,
    recipe: str = "fast",
    head: str = "siren",
    seed: int = 0,
    out: str | Path | None = None,
    overrides: Sequence[str] = (),
    quiet: bool = False,
) -> FittedRun:
    """Fit a field to a shape, extract its part-labelled mesh, and measure it, as `train.py` does.

    Settings of the process (allocator, threads, library of matrix products, loggers) are put back afterwards, and
    torch's default generator is as it was.

    Args:
        shape: From `load_shape`, or what that takes.
        recipe: `fast`, `points`, `paper` or `smoke`.
        head: `relu`, `siren`, `hybrid`, `deep_skip`, or `none` for a field without parts.
        seed: Of initialisation and samples.
        out: A folder for the run's files, which is made; the same call goes on where it was stopped, and a finished
            run is not run again. None: no file is left.
        overrides: More values as on the command line, e.g. `["trainer.max_steps=800", "extraction.resolution=384"]`.
        quiet: Whether to show neither lines nor a progress bar.

    Raises:
        InputError: Anything that can be mended: shape, labels, a value, a folder of another run.
        KeyboardInterrupt: Ctrl-C; with `out` the same call goes on from there.
    """
    cfg = _composed(recipe, head, seed, overrides)
    with ExitStack() as stack:
        folder = Path(stack.enter_context(TemporaryDirectory()) if out is None else out).expanduser().absolute()
        given = shape.name if isinstance(shape, Shape) else str(shape)
        OmegaConf.update(cfg, "shape", given)
        OmegaConf.update(cfg, "paths.outputs", str(folder))
        stack.enter_context(_speaking(quiet))
        build.check_config(cfg)
        truth = shape if isinstance(shape, Shape) else load_shape(shape)
        if head != "none":
            shapes.require_parts(truth)
        stack.enter_context(process_settings())
        stack.enter_context(large_pieces())
        outcome = _fitted(cfg, truth, folder, keep_files=out is not None)
        field, mesh = _results(outcome, folder)
    scores = outcome.row.scores[cfg.evaluation.primary]
    return FittedRun(field, mesh, scores, outcome.row, None if out is None else folder)


def load_field(path: str | Path) -> JointField:
    """Load a fitted field: a `field.ckpt`, or the run folder that holds one.

    Raises:
        InputError: There is none, or it cannot be read.
    """
    path = Path(path).expanduser()
    return JointField.load(path / FIELD if path.is_dir() else path)


def _composed(recipe: str, head: str, seed: int, overrides: Sequence[str]) -> DictConfig:
    require_one_of("recipe", recipe, choices("recipe"))
    require_one_of("head", head, choices("head"))
    words = [f"recipe={recipe}", f"head={head}", f"seed={seed}", *overrides]
    try:
        with initialize_config_module("jointsdf.conf", version_base="1.3"):
            return compose("config", words)
    except (HydraException, OmegaConfBaseException) as error:
        raise InputError(f"{' '.join(words)}: {first_line(error)}") from error


def _fitted(cfg: DictConfig, shape: Shape, folder: Path, *, keep_files: bool) -> Outcome:
    try:
        return fit_shape(cfg, shape, folder, Stopwatch(), keep_files=keep_files)
    except SystemExit as stop:  # a signal came during the fit
        if stop.code == 128 + signal.SIGINT:
            raise KeyboardInterrupt from None
        raise


def _results(outcome: Outcome, folder: Path) -> tuple[JointField, PartMesh]:
    """Field and mesh of this run, or of the folder that holds it already."""
    if outcome.field is not None and outcome.mesh is not None:
        mesh = outcome.mesh
        return outcome.field, PartMesh(mesh.vertices, mesh.faces, mesh.labels)
    found, labels, _ = read_labelled_ply(folder / "mesh.ply")
    return JointField.load(folder / FIELD), PartMesh(found.vertices, found.faces, labels)


@contextmanager
def _speaking(quiet: bool) -> Iterator[None]:
    """Within the block the package's lines go to stderr, unless the program has handlers of its own; or none go."""
    ours = logging.getLogger("jointsdf")
    level, handler = ours.level, Lines()
    adds = not quiet and not ours.hasHandlers()
    with library_logs_quiet(), no_progress() if quiet else nullcontext():
        if adds:
            ours.addHandler(handler)
        ours.setLevel(logging.CRITICAL if quiet else min(level or logging.INFO, logging.INFO))
        try:
            yield
        finally:
            ours.removeHandler(handler)
            ours.setLevel(level)
