"""The library's public functions: load a shape, fit a field, load a fitted field.

>>> import jointsdf
>>> shape = jointsdf.load_shape("part_01")
>>> shape.name, len(shape.mesh.part_ids)
('part_01', 6)
"""

import os
import signal
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hydra import compose, initialize_config_module
from hydra.errors import HydraException
from omegaconf import DictConfig
from omegaconf.errors import OmegaConfBaseException

from jointsdf import shapes
from jointsdf.cli_logging import log_to_stderr
from jointsdf.errors import InputError, first_line, require_one_of
from jointsdf.experiment import build
from jointsdf.experiment.help import choices
from jointsdf.experiment.process import process_settings
from jointsdf.experiment.quoting import escape_interpolations, quote_override
from jointsdf.experiment.result import primary_scores
from jointsdf.experiment.run import Outcome, fit_shape
from jointsdf.experiment.stopwatch import Stopwatch
from jointsdf.export.about import origin_of
from jointsdf.model.field import JointField
from jointsdf.runs.folder import FIELD
from jointsdf.runs.row import ResultRow
from jointsdf.shapes.arrays import from_arrays
from jointsdf.shapes.units import AUTO
from jointsdf.threads import large_pieces
from jointsdf.user_paths import expand_home
from jointsdf.values import Scan, Shape, Subject
from jointsdf.viewing.part_mesh import PartMesh, stored_mesh


@dataclass(frozen=True)
class FittedRun:
    """Result of `fit`.

    Attributes:
        field: The fitted field; `field.query(points)` in file units.
        mesh: The extracted mesh, file frame, one part id per face.
        scores: Metrics of the primary protocol, by name, e.g. `cd_l1`, or of held-out points; all are in `row.scores`.
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
    unit: str = AUTO,
) -> Shape:
    """Load a ground truth with its part labels, in its own units.

    Args:
        source: A catalogue name (`part_01`, `abc_0001`) or the path of a ply, obj, stl, off, glb, gltf, step,
            stp or p21 file, compressed by gzip (.gz) or not.
        vertices: Positions, shape (v, 3), instead of `source`.
        faces: Vertex indices of triangles, shape (f, 3), with `vertices`.
        labels: `auto` (the shape's own, else geometric segmentation), `geometric`, `brep`, `partfield`, `none`, a label
            file, `<mesh file>:<column>`; or with arrays one integer per face or vertex.
        num_parts: Number of parts, for a provider that can choose.
        partfield_dir: PartField's output folder, for `labels="partfield"`.
        abc_root: Folder of the ABC shapes; `$JOINTSDF_ABC`, else `data/abc`.
        name: Name of a shape of arrays.
        unit: Length unit where the file names none: mm, cm, m, um, in or ft; `auto`: mm is assumed.

    Raises:
        InputError: The shape or its labels cannot be used; one line with the value and the fix.

    >>> load_shape("part_01", labels="none").mesh.part_ids.tolist()
    []
    """
    if (source is None) == (vertices is None):
        raise InputError("load_shape: give a name or a path, or else vertices= and faces=")
    if source is None:
        if faces is None:
            raise InputError("load_shape: vertices= without faces=; give the triangles' vertex indices, shape (f, 3)")
        options = {"labels": labels, "num_parts": num_parts, "partfield_dir": partfield_dir, "name": name}
        return from_arrays(vertices, faces, **options, unit=unit)
    if not isinstance(labels, str | Path):
        raise InputError("load_shape: labels= of a path is a provider or a label file; arrays go with vertices=")
    return shapes.load(
        str(source),
        labels=str(labels),
        num_parts=num_parts,
        partfield_dir=partfield_dir,
        abc_root=abc_root or os.environ.get("JOINTSDF_ABC", "data/abc"),
        abc_missing="error",
        segmented=False,
        unit=unit,
    )


def fit(
    shape: Subject | str | Path,
    *,
    recipe: str = "fast",
    head: str = "siren",
    seed: int = 0,
    out: str | Path | None = None,
    overrides: Sequence[str] = (),
    quiet: bool = False,
) -> FittedRun:
    """Fit a field to a shape, extract its part-labelled mesh, and measure it, as `train.py` does.

    Settings of the process (allocator, threads, library of matrix products, loggers, torch's default generator) are
    restored afterwards.

    Args:
        shape: From `load_shape` or `load_cloud`, or its `source`.
        recipe: `fast`, `points`, `network`, `paper` or `smoke`.
        head: `relu`, `siren`, `hybrid`, `deep_skip`, or `none` for a field without parts.
        seed: Seed of initialisation and samples.
        out: A folder for the run's files, which is made; the same call resumes a stopped run, and returns a finished
            one. None: no file is left.
        overrides: More values as on the command line, e.g. `["trainer.max_steps=800", "extraction.resolution=384"]`.
        quiet: Whether to show neither log lines nor a progress bar.

    Raises:
        InputError: The shape, its labels or a value cannot be used, or the folder holds another run.
        KeyboardInterrupt: Ctrl-C; with `out` the same call resumes.
    """
    cfg, escape = _compose(recipe, head, seed, overrides), escape_interpolations
    with ExitStack() as stack:
        folder = Path(stack.enter_context(TemporaryDirectory()) if out is None else expand_home(str(out))).absolute()
        cfg.shape = escape(shape.name if isinstance(shape, Shape | Scan) else str(shape))
        cfg.paths.outputs, cfg.paths.abc_missing = escape(str(folder)), "error"
        stack.enter_context(log_to_stderr(quiet))
        build.check_config(cfg)
        if cfg.reuse:
            raise InputError("reuse=true: the row of another study holds no field; leave it out")
        truth = shape if isinstance(shape, Shape | Scan) else build.load_shape(cfg)
        if cfg.head.name != "none":
            shapes.require_parts(truth)
        stack.enter_context(process_settings())
        stack.enter_context(large_pieces())
        outcome = _fit(cfg, truth, folder, keep_files=out is not None)
        field, mesh = _field_and_mesh(outcome, truth, folder)
    scores = primary_scores(cfg, outcome.row.scores)
    return FittedRun(field, mesh, scores, outcome.row, None if out is None else folder)


def load_field(path: str | Path) -> JointField:
    """Load a fitted field, for inference on the CPU.

    Args:
        path: A `field.ckpt`, or the run folder that holds one.

    Raises:
        InputError: There is none, or it cannot be read.
    """
    path = Path(expand_home(str(path)))
    return JointField.load(path / FIELD if path.is_dir() else path)


def _compose(recipe: str, head: str, seed: int, overrides: Sequence[str]) -> DictConfig:
    require_one_of("recipe", recipe, choices("recipe"))
    require_one_of("head", head, choices("head"))
    overrides = [f"recipe={recipe}", f"head={head}", f"seed={seed}", *map(quote_override, overrides)]
    try:
        with initialize_config_module("jointsdf.conf", version_base="1.3"):
            return compose("config", overrides)
    except (HydraException, OmegaConfBaseException) as error:
        raise InputError(f"{' '.join(overrides)}: {first_line(error)}") from error


def _fit(cfg: DictConfig, shape: Subject, folder: Path, *, keep_files: bool) -> Outcome:
    try:
        return fit_shape(cfg, shape, folder, Stopwatch(), keep_files=keep_files)
    except SystemExit as stop:  # raised by a signal during the fit
        if stop.code == 128 + signal.SIGINT:
            raise KeyboardInterrupt from None
        raise


def _field_and_mesh(outcome: Outcome, truth: Subject, folder: Path) -> tuple[JointField, PartMesh]:
    """Field and mesh of the outcome, read from the folder where the run was finished before."""
    field = outcome.field or JointField.load(folder / FIELD)
    field.about = origin_of(outcome.row)
    mesh = outcome.mesh or stored_mesh(folder, is_empty=outcome.row.status == "empty_mesh")
    return field, PartMesh(mesh.vertices, mesh.faces, mesh.labels, truth.unit, truth.up)
