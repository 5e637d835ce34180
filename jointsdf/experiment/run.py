"""One run from config to result row: the README's data flow, read top to bottom."""

import logging
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Float
from numpy import ndarray
from omegaconf import DictConfig

from jointsdf.evaluation.protocol import GroundTruth, Scores
from jointsdf.evaluation.reference_scores import companions
from jointsdf.experiment import build as assembly
from jointsdf.experiment.summary import files_to_open, in_words, summary
from jointsdf.experiment.tensorboard import log_result
from jointsdf.extraction.resolution import settled
from jointsdf.model.field import JointField
from jointsdf.phases import phase, tell
from jointsdf.runs import folder as run_folder
from jointsdf.runs import status as run_state
from jointsdf.runs.provenance import code_state, provenance
from jointsdf.runs.reuse import known_row
from jointsdf.runs.row import ResultRow, config_hash, write_row
from jointsdf.shapes.mesh_report import MeshReport, mesh_report
from jointsdf.threads import large_pieces
from jointsdf.training.fit import board_of, fit, save_field
from jointsdf.training.hardware import keep_freed_memory, peak_memory_mb, reset_peak_memory
from jointsdf.training.matrix_products import use_matmul
from jointsdf.values import LabelledMesh, Normalisation, Shape
from jointsdf.viewing.export import write_mesh
from jointsdf.viewing.render import compare, write_png

log = logging.getLogger(__name__)

KEPT = ".companions"  # below the outputs: floors and ceilings by shape and grid
SURFACE, AGAINST_TRUTH = "the field's surface and its part labels", "distances and labels against the truth"
SHOWN = {"evaluate": "measure", "picture": "draw"}  # stages whose name in a row is not the one that a user reads


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
    reset_peak_memory()
    keep_freed_memory()
    code_state()
    with watch("load", str(cfg.shape)):
        assembly.checked(cfg)
        shape = assembly.load_shape(cfg)
    folder = assembly.folder_of(cfg)
    settings, numbers = assembly.settings_of(cfg, shape)
    if row := stored_row(cfg, folder, settings, numbers, wait=wait):
        return row
    with watch("prepare", "points, labels and distances"):
        torch.manual_seed(cfg.seed)
        data, module = assembly.build(cfg, shape)
        report = mesh_report(shape, data.cloud.normalisation.scale, assembly.first_resolution(cfg))
        measures = assembly.measures(cfg, report.resolution)
        report.log()
    with run_state.lock(folder, wait=wait):
        if row := run_folder.finished_row(folder, numbers, force=cfg.force, reuse=cfg.reuse):
            return row  # the process that was waited for made it
        run_state.begin(folder)
        run_folder.claim(folder, settings, numbers, resume=cfg.resume, force=cfg.force)
        log.info("%s", folder)
        preview = assembly.preview(cfg, shape, measures)
        how = {key: cfg.trainer[key] for key in ("accelerator", "checkpoint_seconds", "log_every")}
        products = assembly.products(cfg)
        with phase("fit", f"{cfg.trainer.max_steps} steps, recipe {cfg.recipe}, head {cfg.head.name}"):
            watch.seconds["fit"], machine = fit(module, data, folder, preview=preview, products=products, **how)
        save_field(module.field, folder / run_folder.FIELD)
        with watch("extract", SURFACE):
            measures, mesh = extracted(module.field, measures, settle=cfg.extraction.resolution == "auto")
            report = report.on_grid(measures.extraction.resolution)
            write_mesh(folder, mesh)
        with watch("evaluate", AGAINST_TRUTH):
            kept = Path(cfg.paths.outputs, KEPT)
            scores = measure(measures, shape, mesh, data.cloud.normalisation, kept)
        with watch("picture", "preview.png and TensorBoard"):
            show(cfg, folder, shape, mesh, module.field, scores[cfg.evaluation.primary], report.resolution)
        hashes = {"config_hash": config_hash(numbers), "settings_hash": config_hash(assembly.shared_settings(settings))}
        row = result_row(cfg, shape, report, module.field, mesh, scores, watch.seconds, hashes, machine)
        write_row(folder, row)
        (folder / run_folder.CHECKPOINT).unlink(missing_ok=True)
        run_state.end(folder)
    log.info(summary(row, cfg.evaluation.primary, folder))
    if said := in_words(row, measures.protocols, shape.mesh, mesh):
        log.info(said)
    if not mesh.is_empty:
        log.info(files_to_open(folder))
    return row


def stored_row(
    cfg: DictConfig, folder: Path, settings: Mapping[str, Any], numbers: Mapping[str, Any], *, wait: bool
) -> ResultRow | None:
    """The run's row, where its folder holds it already or, with `reuse`, another study does; the latter is kept there.

    Raises:
        Busy: Another process works on the same run, and `wait` is false.
        InputError: The folder holds another config, or a damaged one.
    """
    row = run_folder.finished_row(folder, numbers, force=cfg.force, reuse=cfg.reuse)
    if row:
        log.info("%s holds this run's result already; force=true runs it again", folder)
        run_state.end(folder)
    elif cfg.reuse and not cfg.force:
        row = known_row(config_hash(numbers), folder, Path(cfg.paths.outputs), Path(cfg.paths.results))
        if row:
            with run_state.lock(folder, wait=wait):
                run_folder.claim(folder, settings, numbers, resume="never", force=False)
                write_row(folder, row)
                run_state.end(folder)
            log.info("%s: taken from %s; reuse=false runs it here", folder, row.provenance[run_folder.REUSED])
    if row:
        log.info(summary(row, cfg.evaluation.primary, folder))
    return row


def extracted(
    field: JointField, measures: assembly.Measures, *, settle: bool
) -> tuple[assembly.Measures, LabelledMesh]:
    """The field's mesh, and the measures with the grid that it was made on: a finer one where `settle` asks for it."""
    asked = 0

    def sdf(points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        nonlocal asked
        asked += len(points)
        tell(facts=f"{asked / 1e6:.1f} million points evaluated")
        return field.network_sdf(points)

    if settle:
        extraction, surface = settled(measures.extraction, sdf)
    else:
        extraction, surface = measures.extraction, measures.extraction.surface(sdf)
    mesh = extraction.labelled(surface, field.network_part, field.normalisation)
    return replace(measures, extraction=extraction), mesh


def measure(
    measures: assembly.Measures, shape: Shape, mesh: LabelledMesh, normalisation: Normalisation, kept: Path | None
) -> Scores:
    """Every metric of every protocol, with floors and ceilings; those are kept in the folder for the next run."""
    truth = GroundTruth(shape.mesh, measures.protocols)
    tell(0, 2, "floors and ceilings")
    beside = companions(truth, shape, measures.extraction, normalisation, kept)
    tell(1, facts="scores")
    return {name: scores | beside[name] for name, scores in truth.scores(mesh).items()}


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
    picture = compare(shape.mesh, mesh, captions=(f"{shape.name}: ground truth", made_by))
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
    hashes: dict[str, str],
    machine: dict[str, str | int],
) -> ResultRow:
    """The run as a row."""
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
        provenance=provenance(
            config_hash=hashes["config_hash"],
            settings_hash=hashes["settings_hash"],
            **machine,
            mesh_sha256=shape.mesh_sha256,
            label_provider=shape.label_provider,
            resolution=report.resolution,
            **report.facts(),
        ),
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
        cfg, shape = assembly.stored_truth(folder)
        row = run_folder.stored_row(folder)
    use_matmul(str(row.provenance.get("matmul", "default")))  # the last bits of the field depend on it
    field = JointField.load(folder / run_folder.FIELD)
    resolution = row.provenance["resolution"]
    assert isinstance(resolution, int), "a row without its grid"
    with assembly.settings_errors(f"{folder / run_folder.CONFIG} is damaged"):
        measures = assembly.measures(cfg, resolution)
    with phase("extract", SURFACE):
        _, mesh = extracted(field, measures, settle=False)
    with phase("measure", AGAINST_TRUTH):
        return row, measure(measures, shape, mesh, field.normalisation, None)
