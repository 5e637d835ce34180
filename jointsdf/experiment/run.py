"""One run from config to result row: the data flow of docs/architecture.md, top to bottom."""

import logging
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from omegaconf import DictConfig

from jointsdf.cli_logging import warnings_kept
from jointsdf.data.datamodule import ShapeDataModule
from jointsdf.data.point_cloud import Cloud
from jointsdf.evaluation.protocol import Scores
from jointsdf.experiment import build
from jointsdf.experiment.existing_row import find_row
from jointsdf.experiment.measurement import EXTRACTING, MEASURING, extract, measure
from jointsdf.experiment.process import process_settings
from jointsdf.experiment.result import data_facts, primary_scores, result_row, save_page, save_pictures
from jointsdf.experiment.settings import folder_of, resolve_settings, shared_settings, trusted
from jointsdf.experiment.solids import save_solids
from jointsdf.experiment.stopwatch import Stopwatch
from jointsdf.experiment.summary import last_lines, summary
from jointsdf.experiment.tensorboard import preview_factory
from jointsdf.extraction.resolution import cell_size, grid_warnings
from jointsdf.model.field import JointField
from jointsdf.phases import phase
from jointsdf.runs import folder as run_folder
from jointsdf.runs import status
from jointsdf.runs.lock import lock
from jointsdf.runs.provenance import code_state, provenance
from jointsdf.runs.row import ResultRow, config_hash, write_row
from jointsdf.shapes.clouds.report import CloudReport
from jointsdf.shapes.mesh_report import MeshReport
from jointsdf.threads import large_pieces
from jointsdf.training.fit import fit, save_field
from jointsdf.training.module import JointSDFModule
from jointsdf.values import LabelledMesh, LabelledPoints, Subject
from jointsdf.viewing.export import write_mesh

log = logging.getLogger(__name__)

CACHE_DIR = ".companions"  # below the outputs; caches reference scores by shape and grid


@dataclass(frozen=True)
class Outcome:
    """Result of a run; field and mesh are None where the row existed before.

    Attributes:
        row: The result row.
        field: The fitted field.
        mesh: The extracted mesh, file frame.
    """

    row: ResultRow
    field: JointField | None = None
    mesh: LabelledMesh | None = None


@dataclass(frozen=True)
class Prepared:
    """Objects of a run, made before its fit.

    Attributes:
        data: Samples of each step.
        module: The untrained field with its objective.
        labelled: Points to which the head's last layer is refitted; None where it is not.
        measures: Extraction with its initial grid, and protocols.
        report: Report of what is fitted.
    """

    data: ShapeDataModule
    module: JointSDFModule
    labelled: LabelledPoints | None
    measures: build.Measures
    report: MeshReport | CloudReport


@large_pieces()
def run(cfg: DictConfig, *, wait: bool = True) -> ResultRow:
    """Fit one shape, extract and measure its mesh, and leave one result row in the run folder.

    A folder that already holds this run's row is left as it is and its row is returned.

    Args:
        cfg: The composed config.
        wait: Whether to wait for another process that works on the same run.

    Raises:
        Busy: Another process works on the same run, and `wait` is false.
        InputError: Shape, labels, config, folder or checkpoint cannot be used, or a loss is not finite.
    """
    watch = Stopwatch()
    with process_settings():
        with watch("load", str(cfg.shape)):
            build.check_config(cfg)
            shape = build.load_shape(cfg)
        return fit_shape(cfg, shape, folder_of(cfg), watch, wait=wait).row


def fit_shape(
    cfg: DictConfig, shape: Subject, folder: Path, watch: Stopwatch, *, wait: bool = True, keep_files: bool = True
) -> Outcome:
    """Run all of `run` after the shape is loaded; call it within `process_settings` and `large_pieces`.

    Args:
        cfg: The config, checked.
        shape: Mesh or point cloud.
        folder: The run folder.
        watch: Times the stages.
        wait: As for `run`.
        keep_files: Whether to write mesh and pictures, for a folder that lasts.

    Raises:
        Busy: As for `run`.
        InputError: As for `run`.
    """
    code = code_state()  # of the code that was loaded, whatever is edited during the fit
    draw_cloud = cache(lambda: build.cloud_of(cfg, shape))
    rate = build.trunk_rate(cfg, shape, draw_cloud)
    settings, fingerprint = resolve_settings(cfg, shape, rate)
    if row := find_row(cfg, folder, settings, fingerprint, shape.unit.name, wait=wait):
        return Outcome(row)
    warned: list[str] = []
    with watch("prepare", "points, labels and distances"), warnings_kept(warned):
        prepared = _prepare(cfg, shape, draw_cloud(), rate)
    with lock(folder, wait=wait), warnings_kept(warned):
        if row := run_folder.finished_row(folder, fingerprint, force=cfg.force, reuse=cfg.reuse, trust=trusted(cfg)):
            log.info(summary(row, cfg.evaluation.primary, folder))
            return Outcome(row)  # made by the process that was waited for
        status.begin(folder)
        run_folder.claim(folder, settings, fingerprint, resume=cfg.resume, force=cfg.force)
        if keep_files:
            log.info("%s", folder)
        machine = _fit(cfg, shape, prepared, folder, watch)
        measures, mesh, scores = _measure(cfg, shape, prepared, folder, watch, keep_files=keep_files)
        field, report, resolution = prepared.module.field, prepared.report, measures.extraction.resolution
        facts = provenance(
            code,
            config_hash=config_hash(fingerprint),
            settings_hash=config_hash(shared_settings(settings)),
            **machine,
            resolution=resolution,
            **report.facts(),
            **data_facts(cfg, shape),
            grid_cell=cell_size(resolution) * field.normalisation.scale,
        )
        row = result_row(cfg, shape, report, field, mesh, scores, watch.seconds, facts)
        write_row(folder, row)
        if keep_files and cfg.viewing.page:
            save_page(folder, shape, mesh, field, row, warned)
        (folder / run_folder.CHECKPOINT).unlink(missing_ok=True)
        status.end(folder)
    for line in last_lines(
        row, cfg.evaluation.primary, folder if keep_files else None, measures.protocols, shape, mesh
    ):
        log.info(line)
    return Outcome(row, field, mesh)


def _prepare(cfg: DictConfig, shape: Subject, cloud: Cloud, rate: float) -> Prepared:
    """Make samples, module and measures, and log the report of what is fitted."""
    data, module = build.data_and_module(cfg, shape, cloud, rate)
    report, scale = build.report_on(shape), cloud.normalisation.scale
    resolution = build.first_resolution(cfg, report.wall / scale, [width / scale for width in report.widths.values()])
    measures = build.measures(cfg, resolution)
    report.log(cell_size(resolution) * scale)
    for warning in grid_warnings(report.wall, report.widths, resolution, scale, shape.unit.name):
        log.warning("%s: %s", report.name, warning)
    return Prepared(data, module, build.labelled(cfg, shape, cloud), measures, report)


def _fit(cfg: DictConfig, shape: Subject, prepared: Prepared, folder: Path, watch: Stopwatch) -> dict[str, str | int]:
    """Fit the field and save it; returns what the fit used of this machine."""
    preview = preview_factory(cfg, shape, prepared.measures.protocols[cfg.evaluation.primary])
    with phase("fit", f"{cfg.trainer.max_steps} steps, recipe {cfg.recipe}, head {cfg.head.name}"):
        on, known = build.fit_machine(cfg), prepared.labelled
        watch.seconds["fit"], machine = fit(prepared.module, prepared.data, folder, on, labelled=known, preview=preview)
    save_field(prepared.module.field, folder / run_folder.FIELD)
    return machine


def _measure(
    cfg: DictConfig, shape: Subject, prepared: Prepared, folder: Path, watch: Stopwatch, *, keep_files: bool
) -> tuple[build.Measures, LabelledMesh, Scores]:
    """Extract and score the mesh, and write mesh and pictures."""
    field, refine = prepared.module.field, cfg.extraction.resolution == "auto"
    with watch("extract", EXTRACTING):
        measures, mesh = extract(field, prepared.measures, refine=refine)
        if keep_files:
            write_mesh(folder, mesh, shape.unit, shape.up)
    with watch("evaluate", MEASURING):
        scores = measure(measures, shape, mesh, field, Path(cfg.paths.outputs, CACHE_DIR))
    if keep_files:
        with watch("picture", "preview.png and TensorBoard"):
            save_pictures(cfg, folder, shape, mesh, field, primary_scores(cfg, scores), measures.extraction.resolution)
            save_solids(cfg, folder, shape, mesh, field)
    return measures, mesh, scores
