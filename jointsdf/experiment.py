"""One run from config to result row: the README's data flow, read top to bottom. The only file that knows Hydra."""

import logging
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from hydra.utils import instantiate
from lightning import Callback, Trainer
from lightning.pytorch.callbacks import RichProgressBar
from lightning.pytorch.loggers import TensorBoardLogger
from omegaconf import DictConfig, OmegaConf

from jointsdf import run_folder, shapes
from jointsdf.callbacks import Checkpoints, Preview, extract, log_result, resumable
from jointsdf.data import ShapeDataModule, network_distance
from jointsdf.evaluation import Protocol, evaluate
from jointsdf.extraction import Extraction
from jointsdf.machine import peak_memory_mb, reset_peak_memory
from jointsdf.module import JointSDFModule
from jointsdf.results import ResultRow, config_hash, provenance, read_row, write_row
from jointsdf.sampling import Counts
from jointsdf.trunk import JointField
from jointsdf.values import InputError, LabelledMesh, Normalisation, Shape
from jointsdf.viewing.export import tensorboard_mesh, write_mesh
from jointsdf.viewing.render import compare, write_png

log = logging.getLogger(__name__)

BOARD_RESOLUTION = 64  # grid of the mesh tab's mesh: its vertices must stay below 65,536
Scores = dict[str, dict[str, float]]


@dataclass
class Stopwatch:
    """Seconds of each stage of a run."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Time the block under this name."""
        start = time.perf_counter()
        yield
        self.seconds[stage] = time.perf_counter() - start


def run(cfg: DictConfig) -> ResultRow:
    """Fit one shape, extract and measure its mesh, and leave one result row in the run folder.

    A folder that already holds this run's row is left as it is and its row is returned.

    Raises:
        InputError: Anything the user can mend: shape, labels, config, folder, checkpoint, a loss that is not finite.
    """
    watch = Stopwatch()
    reset_peak_memory()
    with watch("load"):
        shape = load_shape(cfg)
        folder, numbers = claim(cfg, shape)
    if (folder / "result.json").is_file():
        log.info("%s holds this run's result already; force=true runs it again", folder)
        return read_row(folder / "result.json")
    log.info("%s", folder)
    with watch("prepare"):
        torch.manual_seed(cfg.seed)
        data, module = build(cfg, shape)
    tensorboard = TensorBoardLogger(folder, name="", version="tb", default_hp_metric=False)
    watch.seconds["fit"], device = fit(cfg, folder, shape, data, module, tensorboard)
    module.field.save(folder / "field.ckpt")
    with watch("extract"):
        mesh = extract(module.field, instantiate(cfg.extraction))
        write_mesh(folder, mesh)
    with watch("evaluate"):
        scores = measure(cfg, shape, mesh, data.cloud.normalisation)
    with watch("picture"):
        show(folder, cfg, shape, mesh, module, scores[cfg.evaluation.primary], tensorboard)
    row = result_row(cfg, shape, module, mesh, scores, watch.seconds, identity_hash=config_hash(numbers), device=device)
    write_row(folder, row)
    (folder / "last.ckpt").unlink(missing_ok=True)
    log.info(summary(row, cfg.evaluation.primary, folder))
    return row


def load_shape(cfg: DictConfig) -> Shape:
    """The ground truth that the config names."""
    return shapes.load(
        str(cfg.shape),
        labels=str(cfg.labels),
        abc_root=cfg.paths.abc_root,
        abc_missing=cfg.paths.abc_missing,
        segmented=cfg.head.name != "none",
    )


def claim(cfg: DictConfig, shape: Shape) -> tuple[Path, dict[str, Any]]:
    """The run's folder, made this run's own, and the run's identity."""
    folder = Path(cfg.paths.outputs, cfg.study, cfg.variant, cfg.head.name, shape.name, f"seed{cfg.seed}")
    settings: Any = OmegaConf.to_container(cfg, resolve=True)
    given = Path(str(cfg.shape))
    settings["shape"] = str(given.resolve()) if given.is_file() else shape.name
    if Path(str(cfg.labels)).is_file():
        settings["labels"] = str(Path(cfg.labels).resolve())
    numbers = run_folder.identity(
        settings, name=shape.name, mesh_sha256=shape.mesh_sha256, labels_sha256=shape.labels_sha256
    )
    run_folder.claim(folder, settings, numbers, resume=cfg.resume, force=cfg.force)
    return folder, numbers


def build(cfg: DictConfig, shape: Shape) -> tuple[ShapeDataModule, JointSDFModule]:
    """Samples and module from the config."""
    settings: Any = OmegaConf.to_container(cfg.data, resolve=True)
    counts = Counts(**settings.pop("counts"))
    if cfg.loss.weights.signed_distance == 0:
        settings["pool_size"] = 0
    data = ShapeDataModule(shape, counts, seed=cfg.seed, **settings)
    trunk: Any = OmegaConf.to_container(cfg.trunk, resolve=True)
    head: Any = OmegaConf.to_container(cfg.head, resolve=True)
    part_ids = data.cloud.part_ids if cfg.head.name != "none" else np.arange(0)
    loss = instantiate(cfg.loss, _convert_="all")
    module = JointSDFModule(
        JointField(trunk, head, part_ids, data.cloud.normalisation),
        loss["terms"],
        loss["weights"],
        loss["schedules"],
        instantiate(cfg.optimizer),
        seed=cfg.seed,
        **{key: cfg.trainer[key] for key in ("max_steps", "head_lr", "clip", "cosine", "warmup")},
    )
    return data, module


def fit(
    cfg: DictConfig,
    folder: Path,
    shape: Shape,
    data: ShapeDataModule,
    module: JointSDFModule,
    tensorboard: TensorBoardLogger,
) -> tuple[float, str]:
    """Train to `max_steps`, going on from the folder's checkpoint where there is one.

    Returns:
        Seconds of training, those before an interruption included, and the name of the device.

    Raises:
        InputError: The checkpoint cannot be read, or a loss is not finite.
        SystemExit: Ctrl-C or SIGTERM; the checkpoint is written.
    """
    checkpoints = Checkpoints(folder / "last.ckpt", cfg.trainer.checkpoint_seconds)
    interactive = sys.stdout.isatty()
    callbacks: list[Callback] = [checkpoints, *([RichProgressBar(refresh_rate=10)] if interactive else [])]
    if cfg.trainer.preview_every:
        callbacks.append(preview(cfg, shape, tensorboard))
    trainer = Trainer(
        accelerator=cfg.trainer.accelerator,
        devices=1,
        max_steps=cfg.trainer.max_steps,
        max_epochs=-1,
        logger=tensorboard,
        callbacks=callbacks,
        log_every_n_steps=cfg.trainer.log_every,
        enable_checkpointing=False,
        enable_progress_bar=interactive,
        enable_model_summary=False,
        inference_mode=False,
    )
    try:
        trainer.fit(module, datamodule=data, ckpt_path=resumable(checkpoints.path, module), weights_only=True)
    except SystemExit:
        log.warning("stopped at step %d; the same command goes on from there", trainer.global_step)
        raise SystemExit(128 + (checkpoints.asked_to_stop or 2)) from None
    device = torch.cuda.get_device_name(module.device) if module.device.type == "cuda" else module.device.type
    module.to("cpu").eval()
    return checkpoints.seconds_trained, device


def preview(cfg: DictConfig, shape: Shape, tensorboard: TensorBoardLogger) -> Preview:
    """The coarse look at the run under way."""
    metrics = instantiate(cfg.evaluation.protocols[cfg.evaluation.primary].metrics, _convert_="all")
    resolution = cfg.trainer.preview_resolution
    return Preview(
        tensorboard.experiment,
        shape.mesh,
        Protocol("preview", 5000, "truth", metrics),
        Extraction(resolution=resolution),
        cfg.trainer.preview_every,
        partial(compare, captions=("ground truth", f"preview at {resolution}^3, not a result")),
    )


def measure(cfg: DictConfig, shape: Shape, mesh: LabelledMesh, normalisation: Normalisation) -> Scores:
    """Every metric of every protocol, with floors and ceilings."""
    exact = network_distance(shape, normalisation)
    ceiling = instantiate(cfg.extraction).labelled_mesh(
        exact.signed, lambda points: shape.mesh.labels[exact.closest_face(points)], normalisation
    )
    return evaluate(mesh, shape.mesh, ceiling, instantiate(cfg.evaluation.protocols, _convert_="all"))


def show(
    folder: Path,
    cfg: DictConfig,
    shape: Shape,
    mesh: LabelledMesh,
    module: JointSDFModule,
    scores: dict[str, float],
    tensorboard: TensorBoardLogger,
) -> None:
    """`preview.png` and the run's last TensorBoard entries."""
    picture = compare(
        shape.mesh,
        mesh,
        captions=(f"{shape.name}: ground truth", f"{cfg.recipe}, head {cfg.head.name}, {cfg.extraction.resolution}^3"),
    )
    write_png(folder / "preview.png", picture)
    coarse = extract(module.field, Extraction(resolution=BOARD_RESOLUTION))
    settings = {"recipe": cfg.recipe, "head": cfg.head.name, "shape": shape.name, "seed": cfg.seed}
    board_mesh = None if coarse.is_empty else tensorboard_mesh(coarse)
    log_result(tensorboard.experiment, picture, board_mesh, settings, scores, cfg.trainer.max_steps)
    tensorboard.finalize("success")


def result_row(
    cfg: DictConfig,
    shape: Shape,
    module: JointSDFModule,
    mesh: LabelledMesh,
    scores: Scores,
    seconds: dict[str, float],
    *,
    identity_hash: str,
    device: str,
) -> ResultRow:
    """The run as a row."""
    field = module.field
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
        },
        seconds={stage: round(value, 3) for stage, value in seconds.items()} | {"total": round(sum(seconds.values()), 3)},
        peak_memory_mb=peak_memory_mb(),
        scores=scores,
        provenance=provenance(
            config_hash=identity_hash,
            device=device,
            threads=torch.get_num_threads(),
            mesh_sha256=shape.mesh_sha256,
            label_provider=shape.label_provider,
            resolution=cfg.extraction.resolution,
        ),
    )


def summary(row: ResultRow, protocol: str, folder: Path) -> str:
    """The run in one line."""
    scores = row.scores[protocol]
    if row.status == "empty_mesh":
        return f"{row.shape} {row.head}: empty_mesh (the field has no surface in the box), {folder}"
    return (
        f"{row.shape} {row.head}: cd_l1 {scores['cd_l1']:.4f} (floor {scores['cd_l1_floor']:.4f})  nc {scores['nc']:.4f}  "
        f"miou {scores['miou']:.4f} (floor {scores['miou_floor']:.4f})  miou_exact {scores['miou_exact']:.4f} "
        f"(ceiling {scores['miou_exact_ceiling']:.4f})  components {scores['components']:.0f}  "
        f"fit {row.seconds['fit']:.0f} s, total {row.seconds['total']:.0f} s  {folder}"
    )


def measure_again(folder: Path) -> tuple[ResultRow, Scores]:
    """Extract and measure a finished run again, from its field.

    Returns:
        The stored row and the scores measured now.

    Raises:
        InputError: Not a finished run's folder, or its ground truth is no longer there.
    """
    cfg = OmegaConf.create(run_folder.read_config(folder))
    field = JointField.load(folder / "field.ckpt")
    shape = load_shape(cfg)
    mesh = extract(field, instantiate(cfg.extraction))
    return read_row(folder / "result.json"), measure(cfg, shape, mesh, field.normalisation)
