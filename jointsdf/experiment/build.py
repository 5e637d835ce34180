"""Config -> the objects of one run, checked before anything is written. Knows Hydra, as `experiment` does."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from hydra.errors import HydraException
from hydra.utils import instantiate
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from torch.utils.tensorboard import SummaryWriter

from jointsdf import shapes
from jointsdf.data.datamodule import ShapeDataModule
from jointsdf.data.point_cloud import Cloud
from jointsdf.data.sampler import Counts
from jointsdf.errors import InputError, first_line
from jointsdf.evaluation.protocol import Protocol
from jointsdf.experiment.config_checks import check, number_keys
from jointsdf.experiment.tensorboard import Preview
from jointsdf.extraction.extractor import Extraction
from jointsdf.geometry.mesh import relative_area
from jointsdf.model.field import JointField
from jointsdf.runs import folder as run_folder
from jointsdf.shapes.mesh_report import LADDER
from jointsdf.training.matrix_products import CHOICES, Products
from jointsdf.training.module import JointSDFModule
from jointsdf.values import Shape
from jointsdf.viewing.render import compare


@dataclass(frozen=True)
class Measures:
    """How a field becomes a mesh, and how that is measured.

    Attributes:
        extraction: Field -> mesh.
        protocols: Mesh -> scores, by name.
    """

    extraction: Extraction
    protocols: Mapping[str, Protocol]


@contextmanager
def settings_errors(what: str) -> Iterator[None]:
    """Report what constructors say of their arguments as the user's to mend.

    Raises:
        InputError: A constructor refused its arguments, or the config cannot be resolved.
    """
    try:
        yield
    except InputError:
        raise
    except (ValueError, TypeError, HydraException, OmegaConfBaseException) as error:
        cause: BaseException = error
        while isinstance(cause, HydraException) and cause.__cause__ is not None:
            cause = cause.__cause__
        if isinstance(cause, InputError):
            raise cause from error
        message = first_line(cause)
        raise InputError(message if "=" in message else f"{what}: {message}; mend the value in the command") from error


def checked(cfg: DictConfig) -> None:
    """Refuse a config with a value out of range before any work is done; write 10 and 10.0 alike from here on.

    Raises:
        InputError: The first such value, and what is accepted.
    """
    with settings_errors("config"):
        settings: Any = OmegaConf.to_container(cfg, resolve=True)
    check(settings)
    for key in number_keys(settings):
        OmegaConf.update(cfg, key, float(OmegaConf.select(cfg, key)))


def load_shape(cfg: DictConfig) -> Shape:
    """The ground truth that the config names."""
    return shapes.load(
        str(cfg.shape),
        labels=str(cfg.labels),
        num_parts=cfg.get("num_parts"),
        partfield_dir=cfg.get("partfield_dir"),
        abc_root=cfg.paths.abc_root,
        abc_missing=cfg.paths.abc_missing,
        segmented=cfg.head.name != "none",
        step_tolerance=cfg.tessellation.tolerance,
        step_angle=cfg.tessellation.angle,
    )


def folder_of(cfg: DictConfig) -> Path:
    """Where the run's files go; nothing is loaded for it."""
    name = shapes.name_of(str(cfg.shape), abc_root=cfg.paths.abc_root, abc_missing=cfg.paths.abc_missing)
    return Path(cfg.paths.outputs, cfg.study, cfg.variant, cfg.head.name, name, f"seed{cfg.seed}")


def settings_of(cfg: DictConfig, shape: Shape) -> tuple[dict[str, Any], dict[str, Any]]:
    """The resolved config, valid from any working directory, and the part of it that decides the run's numbers."""
    settings: Any = OmegaConf.to_container(cfg, resolve=True)
    given = Path(str(cfg.shape)).expanduser()
    settings["shape"] = str(given.resolve()) if given.is_file() and shape.name != str(cfg.shape) else shape.name
    if Path(str(cfg.labels)).expanduser().is_file():
        settings["labels"] = str(Path(str(cfg.labels)).expanduser().resolve())
    if settings["partfield_dir"] is not None:
        settings["partfield_dir"] = str(Path(str(settings["partfield_dir"])).expanduser().resolve())
    settings["paths"]["abc_root"] = str(Path(cfg.paths.abc_root).expanduser().resolve())
    numbers = run_folder.identity(settings, **identity_of(shape))
    if trunk_rate(cfg, shape) == 1:  # a limit that the shape does not reach decides nothing
        del numbers["trainer"]["full_rate_area"]
    return settings, numbers


def shared_settings(settings: Mapping[str, Any]) -> dict[str, Any]:
    """The part of the resolved config that all runs of one table share, whatever their head, shape and seed."""
    return {key: value for key, value in run_folder.identity(settings).items() if key not in ("head", "shape", "seed")}


def trunk_rate(cfg: DictConfig, shape: Shape) -> float:
    """Factor on the trunk's learning rates: the same points a step are spread thinner over a larger surface."""
    most = cfg.trainer.full_rate_area
    if most is None:
        return 1.0
    if knows_mesh(cfg):
        area = relative_area(shape.mesh)
    else:
        area = Cloud.of(shape.mesh, count=cfg.data.cloud_size, seed=cfg.seed).relative_area()
    return min(1.0, most / area)


def first_resolution(cfg: DictConfig) -> int | str:
    """The grid to begin with: without the mesh its thinnest wall is not known, and the fitted surface alone decides."""
    return LADDER[0] if cfg.extraction.resolution == "auto" and not knows_mesh(cfg) else cfg.extraction.resolution


def knows_mesh(cfg: DictConfig) -> bool:
    """Whether a run may take more from the mesh than points and labels."""
    return bool(cfg.data.distances == "mesh")


def stored_truth(folder: Path) -> tuple[DictConfig, Shape]:
    """The config that a run folder holds, and the run's ground truth.

    Raises:
        InputError: There is no config, or the ground truth is not what it was. One line.
    """
    stored = run_folder.read_config(folder)
    cfg = OmegaConf.create(stored)
    with settings_errors(f"{folder / run_folder.CONFIG} is damaged"):
        shape = load_shape(cfg)
    if (now := identity_of(shape)) != (before := stored["identity"]["shape"]):
        changed = ", ".join(f"{key} ({before.get(key)} -> {now[key]})" for key in now if before.get(key) != now[key])
        raise InputError(f"{folder}: its ground truth is not there any more: {changed}; put it back at {cfg.shape}")
    return cfg, shape


def identity_of(shape: Shape) -> dict[str, str]:
    """What tells one ground truth from another."""
    return {"name": shape.name, "mesh_sha256": shape.mesh_sha256, "labels_sha256": shape.labels_sha256}


def measures(cfg: DictConfig, resolution: int) -> Measures:
    """How the run's mesh is made and measured.

    Args:
        cfg: The composed config.
        resolution: Of the extraction grid, which the config may leave to the shape.

    Raises:
        InputError: A component refuses its settings.
    """
    with settings_errors("extraction"):
        extraction = instantiate(cfg.extraction, resolution=resolution)
    with settings_errors("evaluation"):
        return Measures(extraction, instantiate(cfg.evaluation.protocols, _convert_="all"))


def build(cfg: DictConfig, shape: Shape) -> tuple[ShapeDataModule, JointSDFModule]:
    """The stream of samples, and the field with its objective.

    Raises:
        InputError: A component refuses its settings.
    """
    with settings_errors("data"):
        data = _data(cfg, shape)
    with settings_errors("trunk, head, loss or optimizer"):
        module = _module(cfg, data, trunk_rate(cfg, shape))
        module.configure_optimizers()  # so that a bad rate is refused now, not in the fit
    return data, module


def _data(cfg: DictConfig, shape: Shape) -> ShapeDataModule:
    settings: Any = OmegaConf.to_container(cfg.data, resolve=True)
    counts = Counts(**settings.pop("counts"))
    if cfg.loss.weights.get("signed_distance", 0) == 0:
        settings["pool_size"] = 0
    return ShapeDataModule(shape, counts, seed=cfg.seed, **settings)


def _module(cfg: DictConfig, data: ShapeDataModule, rate: float) -> JointSDFModule:
    trunk: Any = OmegaConf.to_container(cfg.trunk, resolve=True)
    head: Any = OmegaConf.to_container(cfg.head, resolve=True)
    part_ids = data.cloud.part_ids if cfg.head.name != "none" else np.arange(0)
    loss = instantiate(cfg.loss, _convert_="all")
    return JointSDFModule(
        JointField(trunk, head, part_ids, data.cloud.normalisation),
        loss["terms"],
        loss["weights"],
        loss["schedules"],
        instantiate(cfg.optimizer),
        seed=cfg.seed,
        trunk_rate=rate,
        **{key: cfg.trainer[key] for key in ("max_steps", "head_lr", "clip", "cosine", "warmup", "log_every")},
    )


def products(cfg: DictConfig) -> Products:
    """How the run's matrices shall be multiplied."""
    return Products(**{key: cfg.trainer[key] for key in CHOICES})


def preview(cfg: DictConfig, shape: Shape, measures: Measures) -> Callable[[SummaryWriter], Preview] | None:
    """What makes the coarse look at the run under way; None where there is to be none."""
    if not cfg.trainer.preview_every:
        return None
    resolution = cfg.trainer.preview_resolution
    return partial(
        Preview,
        truth=shape.mesh,
        protocol=Protocol("preview", 5000, "truth", measures.protocols[cfg.evaluation.primary].metrics),
        extraction=Extraction(resolution=resolution),
        every=cfg.trainer.preview_every,
        picture=partial(
            compare, captions=("ground truth", f"preview at {resolution}^3, not a result"), width=320, height=240
        ),
    )
