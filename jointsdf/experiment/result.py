"""Result row, pictures and last TensorBoard entries of a finished run."""

from pathlib import Path

from omegaconf import DictConfig

from jointsdf.evaluation.protocol import Scores
from jointsdf.experiment.tensorboard import log_result
from jointsdf.model.field import JointField
from jointsdf.phases import tell
from jointsdf.runs.row import Fact, ResultRow
from jointsdf.shapes.mesh_report import MeshReport
from jointsdf.training.fit import tensorboard_logger
from jointsdf.training.hardware import peak_memory_mb
from jointsdf.values import LabelledMesh, Shape
from jointsdf.viewing.render import render_comparison, write_png


def save_pictures(
    cfg: DictConfig,
    folder: Path,
    shape: Shape,
    mesh: LabelledMesh,
    field: JointField,
    scores: dict[str, float],
    resolution: int,
) -> None:
    """Write `preview.png` and the run's last TensorBoard entries.

    Args:
        cfg: The composed config.
        folder: The run folder.
        shape: Ground truth.
        mesh: Extracted mesh, file frame.
        field: The fitted field.
        scores: Scores of the primary protocol.
        resolution: Grid points of the extraction along each axis.
    """
    caption = f"{cfg.recipe}, head {cfg.head.name}, {resolution}^3"
    tell(0, 2, "preview.png")
    picture = render_comparison(shape.mesh, mesh, captions=(f"{shape.name}: ground truth", caption))
    write_png(folder / "preview.png", picture)
    tell(1, facts="TensorBoard")
    settings = {"recipe": cfg.recipe, "head": cfg.head.name, "shape": shape.name, "seed": cfg.seed}
    log_result(tensorboard_logger(folder), field, mesh, picture, settings, scores, cfg.trainer.max_steps)


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
    """Make the run's result row.

    Args:
        cfg: The composed config.
        shape: Ground truth.
        report: Report of the ground truth's mesh.
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
