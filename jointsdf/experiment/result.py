"""Result row, pictures and last log entries of a finished run."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from omegaconf import DictConfig

from jointsdf.evaluation.protocol import Scores
from jointsdf.experiment.data_settings import sample_settings
from jointsdf.experiment.settings import resolve
from jointsdf.experiment.summary import three_numbers
from jointsdf.experiment.tensorboard import Finished, log_result
from jointsdf.model.field import JointField
from jointsdf.phases import phase, tell
from jointsdf.runs.files import write_atomically
from jointsdf.runs.records import HOLDOUT
from jointsdf.runs.row import Fact, ResultRow
from jointsdf.shapes.clouds.report import CloudReport
from jointsdf.shapes.mesh_report import MeshReport
from jointsdf.training.hardware import peak_memory_mb
from jointsdf.values import LabelledMesh, Scan, Subject
from jointsdf.viewing.error_view import error_colours
from jointsdf.viewing.page.run_page import REPORT, write_run_page
from jointsdf.viewing.page.scene import Fit
from jointsdf.viewing.page.stored_runs import WARNINGS
from jointsdf.viewing.points import beside_fit, what_is_given
from jointsdf.viewing.render import notice, write_png
from jointsdf.viewing.slice import render_slice

NUMBERS_SHARE = 48  # width of the picture, over height of the line of numbers


def save_pictures(
    cfg: DictConfig,
    folder: Path,
    shape: Subject,
    mesh: LabelledMesh,
    field: JointField,
    scores: dict[str, float],
    resolution: int,
) -> None:
    """Write `preview.png` and the run's last log entries.

    The picture shows truth, fit and its error above three numbers and a slice of the field, with the same scale of
    errors; of a cloud without a truth, the points beside the fit.

    Args:
        cfg: The composed config.
        folder: The run folder.
        shape: Mesh or point cloud.
        mesh: Extracted mesh, file frame.
        field: The fitted field.
        scores: Scores of the primary protocol.
        resolution: Grid points of the extraction along each axis.
    """
    name = f"{cfg.recipe}, head {cfg.head.name}"
    tell(0, 3, "meshes")
    captions: tuple[str, ...] = (f"{shape.name}: {what_is_given(shape)}", f"{name}, {resolution}^3")
    if shape.truth is None or mesh.is_empty:
        pictures = {"truth_and_prediction": beside_fit(shape)(mesh, captions=captions)}
    else:
        errors, captions = error_colours(mesh, shape.truth.mesh), (*captions, "error, in the colours of the slice")
        pictures = {"truth_prediction_error": beside_fit(shape)(mesh, captions=captions, errors=errors)}
    if shape.truth is not None:
        tell(1, facts="slice")
        width = next(iter(pictures.values())).shape[1]
        if numbers := three_numbers(cfg, scores, shape.truth):
            pictures["numbers"] = notice(numbers, width, width // NUMBERS_SHARE)
        pictures["slice_truth_fit_error"] = render_slice(shape.truth, field, caption=name, width=width)
    write_png(folder / "preview.png", np.concatenate(list(pictures.values())))
    tell(2, facts=cfg.logger.name)
    done = Finished(shape, field, mesh, pictures, hparams(cfg, shape), scores, cfg.trainer.max_steps)
    log_result(cfg.logger.name, folder, done)


def hparams(cfg: DictConfig, shape: Subject) -> dict[str, Fact]:
    """Plain values that tell runs apart in a log: study, variant, recipe, head, shape, seed, steps, loss weights.

    A weight that follows a schedule is its text.
    """
    named = {"study": str(cfg.study), "variant": str(cfg.variant), "recipe": cfg.recipe, "head": cfg.head.name}
    weights = {f"weight/{term}": weight for term, weight in resolve(cfg.loss)["weights"].items()}
    plain = {name: w if isinstance(w, int | float) else json.dumps(w) for name, w in weights.items()}
    return {**named, "shape": shape.name, "seed": cfg.seed, "steps": cfg.trainer.max_steps, **plain}


def save_page(
    folder: Path, shape: Subject, mesh: LabelledMesh, field: JointField, row: ResultRow, warnings: Sequence[str]
) -> None:
    """Write `report.html`, which shows the run in a browser, and what it warned of to `warnings.txt`.

    The row is on the disk before; its seconds do not include those of the page, which says them itself.

    Args:
        folder: The run folder.
        shape: Mesh or point cloud.
        mesh: Extracted mesh, file frame.
        field: The fitted field.
        row: The run's row.
        warnings: A line each.
    """
    with phase("page", REPORT):
        if warnings:
            write_atomically(folder / WARNINGS, "".join(f"{line}\n" for line in warnings))
        write_run_page(folder / REPORT, shape, [(Fit(row.head, mesh, field), row)], warnings=warnings)


def data_facts(cfg: DictConfig, shape: Subject) -> dict[str, Fact]:
    """Facts of a row on its data.

    Returns:
        Hash and source of labels; `corruption`, where the training cloud suffers one; `truth` of a point cloud:
        `holdout`, or the mesh that it is scored by.
    """
    sha256 = shape.points_sha256 if isinstance(shape, Scan) else shape.mesh_sha256
    facts: dict[str, Fact] = {"mesh_sha256": sha256, "label_provider": shape.label_provider}
    if corruption := str(sample_settings(cfg).corruption):
        facts["corruption"] = corruption
    if isinstance(shape, Scan):
        facts["truth"] = HOLDOUT if shape.truth is None else shape.truth.name
    return facts


def primary_scores(cfg: DictConfig, scores: Scores) -> dict[str, float]:
    """Scores of the primary protocol, or those by held-out points where there are no others."""
    return scores[HOLDOUT] if HOLDOUT in scores else scores.get(cfg.evaluation.primary, {})


def result_row(
    cfg: DictConfig,
    shape: Subject,
    report: MeshReport | CloudReport,
    field: JointField,
    mesh: LabelledMesh,
    scores: Scores,
    seconds: dict[str, float],
    facts: dict[str, Fact],
) -> ResultRow:
    """Make the run's result row.

    Args:
        cfg: The composed config.
        shape: Mesh or point cloud.
        report: Report of what is fitted.
        field: The fitted field.
        mesh: Extracted mesh.
        scores: All scores by protocol.
        seconds: Seconds of each stage.
        facts: Provenance.
    """
    return ResultRow(
        study=cfg.study,
        variant=cfg.variant,
        recipe=cfg.recipe,
        head=cfg.head.name,
        shape=shape.name,
        seed=cfg.seed,
        status="empty_mesh" if mesh.is_empty else "ok",
        steps=cfg.trainer.max_steps,
        num_parts=len(shape.part_ids),
        counts={
            **({} if shape.truth is None else {"faces_gt": len(shape.truth.mesh.faces)}),
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
