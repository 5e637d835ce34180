"""One run from config to result row: the README's data flow, read top to bottom."""

import logging
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

from jaxtyping import Float
from numpy import ndarray
from omegaconf import DictConfig, OmegaConf

from jointsdf.evaluation.protocol import GroundTruth, Scores
from jointsdf.evaluation.reference_scores import reference_scores
from jointsdf.experiment import build
from jointsdf.experiment.summary import files_to_open, in_words, summary
from jointsdf.experiment.tensorboard import log_result
from jointsdf.extraction.resolution import cell_size, refine_until_stable, thin_wall_warning
from jointsdf.model.field import JointField
from jointsdf.phases import phase, tell
from jointsdf.runs import folder as run_folder
from jointsdf.runs import status
from jointsdf.runs.lock import lock
from jointsdf.runs.provenance import code_state, provenance
from jointsdf.runs.reuse import find_reusable_row
from jointsdf.runs.row import Fact, ResultRow, config_hash, write_row
from jointsdf.shapes.mesh_report import MeshReport, mesh_report
from jointsdf.shapes.stored import stored_truth
from jointsdf.threads import large_pieces
from jointsdf.training.fit import board_of, fit, save_field
from jointsdf.training.hardware import freed_memory_kept, peak_memory_mb, reset_peak_memory
from jointsdf.training.matrix_products import matmul_restored, use_matmul
from jointsdf.values import LabelledMesh, Normalisation, Shape
from jointsdf.viewing.export import write_mesh
from jointsdf.viewing.render import render_comparison, write_png

log = logging.getLogger(__name__)

CACHE_DIR = ".companions"  # below the outputs: reference scores by shape and grid
SURFACE, AGAINST_TRUTH = "the field's surface and its part labels", "distances and labels against the truth"
SHOWN = {"evaluate": "measure", "picture": "draw"}  # stages whose name in a row is not the one that a user reads


@dataclass(frozen=True)
class Outcome:
    """What a run gave.

    Attributes:
        row: The result row.
        field: The fitted field; None where the row was there before.
        mesh: The extracted mesh, file frame; None where the row was there before.
    """

    row: ResultRow
    field: JointField | None = None
    mesh: LabelledMesh | None = None


@dataclass
class Stopwatch:
    """Seconds of each stage of a run, which is shown while it lasts."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def __call__(self, stage: str, what: str) -> Iterator[None]:
        """Time the block under this name, and say what it works on."""
        start = time.perf_counter()
        with phase(SHOWN.get(stage, stage), what):
            yield
        self.seconds[stage] = time.perf_counter() - start


@large_pieces()
def run(cfg: DictConfig, *, wait: bool = True) -> ResultRow:
    """Fit one shape, extract and measure its mesh, and leave one result row in the run folder.

    A folder that already holds this run's row is left as it is and its row is returned.

    Args:
        cfg: The composed config.
        wait: Whether to wait for another process that works on the same run.

    Raises:
        Busy: Another process works on the same run, and `wait` is false.
        InputError: Anything the user can mend: shape, labels, config, folder, checkpoint, a loss that is not finite.
    """
    watch = Stopwatch()
    with process_settings():
        with watch("load", str(cfg.shape)):
            build.check_config(cfg)
            shape = build.load_shape(cfg)
        return fit_shape(cfg, shape, build.folder_of(cfg), watch, wait=wait).row


@contextmanager
def process_settings() -> Iterator[None]:
    """Set what a run needs of the whole process, and put back the allocator and the library of matrix products."""
    reset_peak_memory()
    with freed_memory_kept(), matmul_restored():
        yield


def fit_shape(
    cfg: DictConfig, shape: Shape, folder: Path, watch: Stopwatch, *, wait: bool = True, keep_files: bool = True
) -> Outcome:
    """All of `run` after the shape is loaded, within `large_pieces`.

    Args:
        cfg: The config, checked.
        shape: Ground truth.
        folder: The run folder.
        watch: Times the stages.
        wait: As for `run`.
        keep_files: Whether the folder is kept, so that mesh and pictures are written.

    Raises:
        Busy: As for `run`.
        InputError: As for `run`.
    """
    code = code_state()  # what was loaded, whatever is edited during the fit
    draw_cloud = cache(lambda: build.cloud_of(cfg, shape))
    rate = build.trunk_rate(cfg, shape, draw_cloud)
    settings, fingerprint = build.resolve_settings(cfg, shape, rate)
    if row := find_row(cfg, folder, settings, fingerprint, wait=wait):
        return Outcome(row)
    with watch("prepare", "points, labels and distances"):
        cloud = draw_cloud()
        data, module = build.data_and_module(cfg, shape, cloud, rate)
        report, scale = mesh_report(shape), cloud.normalisation.scale
        resolution = build.first_resolution(cfg, report.wall / scale)
        measures = build.measures(cfg, resolution)
        _log_report(report, resolution, scale)
    with lock(folder, wait=wait):
        if row := run_folder.finished_row(folder, fingerprint, force=cfg.force, reuse=cfg.reuse):
            return Outcome(row)  # the process that was waited for made it
        status.begin(folder)
        run_folder.claim(folder, settings, fingerprint, resume=cfg.resume, force=cfg.force)
        if keep_files:
            log.info("%s", folder)
        preview = build.preview(cfg, shape, measures)
        with phase("fit", f"{cfg.trainer.max_steps} steps, recipe {cfg.recipe}, head {cfg.head.name}"):
            watch.seconds["fit"], machine = fit(module, data, folder, build.fit_machine(cfg), preview=preview)
        save_field(module.field, folder / run_folder.FIELD)
        with watch("extract", SURFACE):
            measures, mesh = extract(module.field, measures, refine=cfg.extraction.resolution == "auto")
            if keep_files:
                write_mesh(folder, mesh)
        with watch("evaluate", AGAINST_TRUTH):
            cache_dir = Path(cfg.paths.outputs, CACHE_DIR)
            scores = measure(measures, shape, mesh, cloud.normalisation, cache_dir)
        resolution = measures.extraction.resolution
        if keep_files:
            with watch("picture", "preview.png and TensorBoard"):
                show(cfg, folder, shape, mesh, module.field, scores[cfg.evaluation.primary], resolution)
        facts = provenance(
            code,
            config_hash=config_hash(fingerprint),
            settings_hash=config_hash(build.shared_settings(settings)),
            **machine,
            mesh_sha256=shape.mesh_sha256,
            label_provider=shape.label_provider,
            resolution=resolution,
            **report.facts(),
            grid_cell=cell_size(resolution) * scale,
        )
        row = result_row(cfg, shape, report, module.field, mesh, scores, watch.seconds, facts)
        write_row(folder, row)
        (folder / run_folder.CHECKPOINT).unlink(missing_ok=True)
        status.end(folder)
    _log_outcome(cfg, row, folder if keep_files else None, measures, shape, mesh)
    return Outcome(row, module.field, mesh)


def _log_report(report: MeshReport, resolution: int, scale: float) -> None:
    report.log(cell_size(resolution) * scale)
    if warning := thin_wall_warning(report.wall, resolution, scale):
        log.warning("%s: %s", report.name, warning)


def _log_outcome(
    cfg: DictConfig, row: ResultRow, folder: Path | None, measures: build.Measures, shape: Shape, mesh: LabelledMesh
) -> None:
    log.info(summary(row, cfg.evaluation.primary, folder))
    if said := in_words(row, measures.protocols, shape.mesh, mesh):
        log.info(said)
    if folder and not mesh.is_empty:
        log.info(files_to_open(folder))


def find_row(
    cfg: DictConfig, folder: Path, settings: Mapping[str, Any], fingerprint: Mapping[str, Any], *, wait: bool
) -> ResultRow | None:
    """The run's row, where its folder holds it already or, with `reuse`, another study does; the latter is kept there.

    Raises:
        Busy: Another process works on the same run, and `wait` is false.
        InputError: The folder holds another config, or a damaged one.
    """
    row = run_folder.finished_row(folder, fingerprint, force=cfg.force, reuse=cfg.reuse)
    if row:
        log.info("%s holds this run's result already; force=true runs it again", folder)
        status.end(folder)
    elif cfg.reuse and not cfg.force:
        row = find_reusable_row(config_hash(fingerprint), folder, Path(cfg.paths.outputs), Path(cfg.paths.results))
        if row:
            _keep_row(row, folder, settings, fingerprint, wait=wait)
    if row:
        log.info(summary(row, cfg.evaluation.primary, folder))
    return row


def _keep_row(
    row: ResultRow, folder: Path, settings: Mapping[str, Any], fingerprint: Mapping[str, Any], *, wait: bool
) -> None:
    """Make a row of another study the run folder's own."""
    with lock(folder, wait=wait):
        run_folder.claim(folder, settings, fingerprint, resume="never", force=False)
        write_row(folder, row)
        status.end(folder)
    log.info("%s: taken from %s; reuse=false runs it here", folder, row.provenance[run_folder.REUSED])


def extract(field: JointField, measures: build.Measures, *, refine: bool) -> tuple[build.Measures, LabelledMesh]:
    """Extract the field's mesh, in the file frame.

    Args:
        field: The fitted field.
        measures: With the grid to begin with.
        refine: Whether to refine the grid until the topology is stable.

    Returns:
        The measures with the grid that was used, and the mesh.
    """
    asked = 0

    def sdf(points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        nonlocal asked
        asked += len(points)
        tell(facts=f"{asked / 1e6:.1f} million points evaluated")
        return field.network_sdf(points)

    extraction = measures.extraction
    extraction, surface = refine_until_stable(extraction, sdf) if refine else (extraction, extraction.surface(sdf))
    mesh = extraction.label_faces(surface, field.network_part, field.normalisation)
    return replace(measures, extraction=extraction), mesh


def measure(
    measures: build.Measures, shape: Shape, mesh: LabelledMesh, normalisation: Normalisation, cache_dir: Path | None
) -> Scores:
    """Every metric of every protocol, with the reference scores, which are cached in the folder for the next run."""
    truth = GroundTruth(shape.mesh, measures.protocols)
    tell(0, 2, "reference scores")
    references = reference_scores(truth, shape, measures.extraction, normalisation, cache_dir)
    tell(1, facts="scores")
    return {name: scores | references[name] for name, scores in truth.scores(mesh).items()}


def show(
    cfg: DictConfig,
    folder: Path,
    shape: Shape,
    mesh: LabelledMesh,
    field: JointField,
    scores: dict[str, float],
    resolution: int,
) -> None:
    """`preview.png` and the run's last TensorBoard entries."""
    made_by = f"{cfg.recipe}, head {cfg.head.name}, {resolution}^3"
    tell(0, 2, "preview.png")
    picture = render_comparison(shape.mesh, mesh, captions=(f"{shape.name}: ground truth", made_by))
    write_png(folder / "preview.png", picture)
    tell(1, facts="TensorBoard")
    settings = {"recipe": cfg.recipe, "head": cfg.head.name, "shape": shape.name, "seed": cfg.seed}
    log_result(board_of(folder), field, mesh, picture, settings, scores, cfg.trainer.max_steps)


def result_row(
    cfg: DictConfig,
    shape: Shape,
    report: MeshReport,
    field: JointField,
    mesh: LabelledMesh,
    scores: Scores,
    seconds: dict[str, float],
    facts: dict[str, Fact],
) -> ResultRow:
    """The run as a row, the facts as its provenance."""
    return ResultRow(
        study=cfg.study,
        variant=cfg.variant,
        recipe=cfg.recipe,
        head=cfg.head.name,
        shape=shape.name,
        seed=cfg.seed,
        status="empty_mesh" if mesh.is_empty else "ok",
        steps=cfg.trainer.max_steps,
        num_parts=len(shape.mesh.part_ids),
        counts={
            "faces_gt": len(shape.mesh.faces),
            "faces_pred": len(mesh.faces),
            "vertices_pred": len(mesh.vertices),
            "parameters_trunk": sum(p.numel() for p in field.trunk.parameters()),
            "parameters_head": sum(p.numel() for p in field.head.parameters()),
            **report.counts(),
        },
        seconds={stage: round(value, 3) for stage, value in seconds.items()}
        | {"total": round(sum(seconds.values()), 3)},
        peak_memory_mb=peak_memory_mb(),
        scores=scores,
        provenance=facts,
    )


@large_pieces()
def measure_again(folder: Path) -> tuple[ResultRow, Scores]:
    """Extract and measure a finished run again, from its field.

    Returns:
        The stored row and the scores measured now.

    Raises:
        InputError: Not a finished run's folder, or its ground truth is no longer there.
    """
    with phase("load", str(folder)):
        settings, shape = stored_truth(folder)
        cfg, row = OmegaConf.create(settings), run_folder.read_result(folder)
    field = JointField.load(folder / run_folder.FIELD)
    resolution = row.provenance["resolution"]
    assert isinstance(resolution, int), "a row without its grid"
    with build.settings_errors(f"{folder / run_folder.CONFIG} is damaged"):
        measures = build.measures(cfg, resolution)
    with process_settings():
        use_matmul(str(row.provenance.get("matmul", "default")))  # the last bits of the field depend on it
        with phase("extract", SURFACE):
            _, mesh = extract(field, measures, refine=False)
        with phase("measure", AGAINST_TRUTH):
            return row, measure(measures, shape, mesh, field.normalisation, None)
