"""Config -> the objects of one run, checked before anything is written. Knows Hydra."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from hydra.errors import HydraException
from hydra.utils import instantiate
from jaxtyping import Int
from numpy import ndarray
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from torch.utils.tensorboard import SummaryWriter

from jointsdf import shapes
from jointsdf.data.datamodule import ShapeDataModule
from jointsdf.data.point_cloud import Cloud
from jointsdf.data.sampler import Counts
from jointsdf.data.samples import SampleSettings, draw_cloud, prepare_samples
from jointsdf.errors import InputError, first_line, require_integer, require_number
from jointsdf.evaluation.protocol import Protocol
from jointsdf.experiment.config_checks import check, number_keys
from jointsdf.experiment.tensorboard import Preview, PreviewSettings
from jointsdf.extraction.extractor import Extraction
from jointsdf.extraction.resolution import LADDER, resolution_for
from jointsdf.geometry.mesh import relative_area
from jointsdf.model.field import JointField
from jointsdf.runs.fingerprint import fingerprint_of
from jointsdf.shapes.loading import LabelRequest
from jointsdf.shapes.readers.step import Tessellation
from jointsdf.shapes.stored import load_configured, shape_identity
from jointsdf.training.fit import FitMachine
from jointsdf.training.matrix_products import CHOICES, Products
from jointsdf.training.module import JointSDFModule
from jointsdf.training.random_state import seeded
from jointsdf.training.settings import FitSettings, Objective
from jointsdf.values import UNMOVED, Normalisation, Shape
from jointsdf.viewing.render import render_comparison

STAND_IN_PARTS = np.arange(2)  # of a field that is built for its checks alone


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


def check_config(cfg: DictConfig) -> None:
    """Refuse a config with a value out of range before any work is done, by building what needs no shape.

    Writes 10 and 10.0 alike from here on.

    Raises:
        InputError: The first such value, and what is accepted.
    """
    settings = _resolved(cfg)
    check(settings)
    for key in number_keys(settings):
        OmegaConf.update(cfg, key, float(OmegaConf.select(cfg, key)))
    Tessellation(**cfg.tessellation)
    LabelRequest(cfg.labels, cfg.num_parts)
    if cfg.trainer.full_rate_area is not None:
        require_number("trainer.full_rate_area", cfg.trainer.full_rate_area, 1e-6)
    with settings_errors("data"):
        counts(cfg), sample_settings(cfg), fit_machine(cfg), preview_settings(cfg)
        require_integer("data.workers", cfg.data.workers, 0, 256)
    with settings_errors("trunk, head, loss or optimizer"), seeded(0):
        trunk_init = {} if cfg.trunk.init != "sphere" else {"init": "siren"}  # the sphere takes a second to fit
        stand_in = _module(cfg, STAND_IN_PARTS, UNMOVED, 1.0, **trunk_init)
        stand_in.configure_optimizers()
    measures(cfg, LADDER[0] if cfg.extraction.resolution == "auto" else cfg.extraction.resolution)


def load_shape(cfg: DictConfig) -> Shape:
    """The ground truth that the config names."""
    return load_configured(_resolved(cfg))


def folder_of(cfg: DictConfig) -> Path:
    """Run folder of a config; nothing is loaded for it."""
    name = shapes.name_of(str(cfg.shape), abc_root=cfg.paths.abc_root, abc_missing=cfg.paths.abc_missing)
    return Path(cfg.paths.outputs, cfg.study, cfg.variant, cfg.head.name, name, f"seed{cfg.seed}")


def resolve_settings(cfg: DictConfig, shape: Shape, rate: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """The resolved config, valid from any working directory, and its fingerprint: what decides the run's numbers.

    Args:
        cfg: The composed config.
        shape: The run's ground truth.
        rate: From `trunk_rate`.
    """
    settings = _resolved(cfg)
    given = Path(str(cfg.shape)).expanduser()
    settings["shape"] = str(given.resolve()) if given.is_file() and shape.name != str(cfg.shape) else shape.name
    if Path(str(cfg.labels)).expanduser().is_file():
        settings["labels"] = str(Path(str(cfg.labels)).expanduser().resolve())
    if settings["partfield_dir"] is not None:
        settings["partfield_dir"] = str(Path(str(settings["partfield_dir"])).expanduser().resolve())
    settings["paths"]["abc_root"] = str(Path(cfg.paths.abc_root).expanduser().resolve())
    fingerprint = fingerprint_of(settings, **shape_identity(shape))
    if rate == 1:  # a limit that the shape does not reach decides nothing
        del fingerprint["trainer"]["full_rate_area"]
    return settings, fingerprint


def shared_settings(settings: Mapping[str, Any]) -> dict[str, Any]:
    """The part of the resolved config that all runs of one table share, whatever their head, shape and seed."""
    return {key: value for key, value in fingerprint_of(settings).items() if key not in ("head", "shape", "seed")}


def trunk_rate(cfg: DictConfig, shape: Shape, cloud: Callable[[], Cloud]) -> float:
    """Factor on the trunk's learning rates: the points of a step are spread thinner over a larger surface.

    Args:
        cfg: The composed config.
        shape: Ground truth, whose area is used where the run may know it.
        cloud: Gives the training cloud, from which the area is estimated elsewhere.
    """
    most = cfg.trainer.full_rate_area
    if most is None:
        return 1.0
    area = relative_area(shape.mesh) if knows_mesh(cfg) else cloud().relative_area()
    return min(1.0, most / area)


def first_resolution(cfg: DictConfig, wall: float) -> int:
    """The grid to begin with; without the mesh its thinnest wall is not known, and the fitted surface alone decides.

    Args:
        cfg: The composed config.
        wall: Thickness of the ground truth's thinnest wall, network length units.
    """
    if cfg.extraction.resolution != "auto":
        return int(cfg.extraction.resolution)
    return resolution_for(wall) if knows_mesh(cfg) else LADDER[0]


def knows_mesh(cfg: DictConfig) -> bool:
    """Whether a run may take more from the mesh than points and labels."""
    return bool(cfg.data.distances == "mesh")


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


def counts(cfg: DictConfig) -> Counts:
    """Points of one step."""
    return Counts(**_resolved(cfg.data.counts))


def sample_settings(cfg: DictConfig) -> SampleSettings:
    """Sizes of cloud and pool; no pool where no term uses it."""
    settings = {key: value for key, value in _resolved(cfg.data).items() if key not in ("counts", "workers")}
    if cfg.loss.weights.get("signed_distance", 0) == 0:
        settings["pool_size"] = 0
    else:
        require_integer("data.pool_size", cfg.data.pool_size, 1)  # a mean over no points is not finite
    return SampleSettings(**settings)


def cloud_of(cfg: DictConfig, shape: Shape) -> Cloud:
    """The training cloud of a run."""
    return draw_cloud(shape, sample_settings(cfg), cfg.seed)


def data_and_module(cfg: DictConfig, shape: Shape, cloud: Cloud, rate: float) -> tuple[ShapeDataModule, JointSDFModule]:
    """The stream of samples, and the field with its objective, initialised from the seed.

    Args:
        cfg: The composed config, checked.
        shape: Ground truth.
        cloud: From `cloud_of`.
        rate: From `trunk_rate`.

    Raises:
        InputError: A component refuses its settings.
    """
    with settings_errors("data"):
        sampler = prepare_samples(shape, cloud, counts(cfg), sample_settings(cfg), cfg.seed)
        data = ShapeDataModule(sampler, cfg.data.workers)
    with settings_errors("trunk, head, loss or optimizer"), seeded(cfg.seed):
        module = _module(cfg, cloud.part_ids, cloud.normalisation, rate)
        module.configure_optimizers()  # so that a bad rate is refused now, not in the fit
    return data, module


def _module(
    cfg: DictConfig, part_ids: Int[ndarray, " k"], normalisation: Normalisation, rate: float, **trunk: Any
) -> JointSDFModule:
    ids = part_ids if cfg.head.name != "none" else np.arange(0)
    field = JointField(_resolved(cfg.trunk) | trunk, _resolved(cfg.head), ids, normalisation)
    settings = {key: cfg.trainer[key] for key in ("max_steps", "head_lr", "clip", "cosine", "warmup", "log_every")}
    objective = Objective(**instantiate(cfg.loss, _convert_="all"))
    return JointSDFModule(
        field, objective, instantiate(cfg.optimizer), FitSettings(seed=cfg.seed, trunk_rate=rate, **settings)
    )


def fit_machine(cfg: DictConfig) -> FitMachine:
    """Where and how the fit runs."""
    return FitMachine(
        Products(**{key: cfg.trainer[key] for key in CHOICES}), cfg.trainer.accelerator, cfg.trainer.checkpoint_seconds
    )


def preview_settings(cfg: DictConfig) -> PreviewSettings:
    """How often and how finely to look at the run under way."""
    return PreviewSettings(cfg.trainer.preview_every, cfg.trainer.preview_resolution)


def preview(cfg: DictConfig, shape: Shape, measures: Measures) -> Callable[[SummaryWriter], Preview] | None:
    """What makes the coarse look at the run under way; None where there is to be none."""
    settings = preview_settings(cfg)
    if not settings.every:
        return None
    captions = ("ground truth", f"preview at {settings.resolution}^3, not a result")
    return partial(
        Preview,
        truth=shape.mesh,
        protocol=Protocol("preview", 5000, "truth", measures.protocols[cfg.evaluation.primary].metrics),
        settings=settings,
        picture=partial(render_comparison, captions=captions, width=320, height=240),
    )


def _resolved(cfg: DictConfig) -> dict[str, Any]:
    with settings_errors("config"):
        settings: Any = OmegaConf.to_container(cfg, resolve=True)
    return dict(settings)
