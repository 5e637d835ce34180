"""Objects of one run from its config, checked before anything is written."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from hydra.utils import instantiate
from jaxtyping import Int
from numpy import ndarray
from omegaconf import DictConfig, OmegaConf

from jointsdf.data.datamodule import ShapeDataModule
from jointsdf.data.point_cloud import Cloud
from jointsdf.data.samples import draw_cloud, labelled_points, prepare_samples
from jointsdf.data.scan_points import require_mesh
from jointsdf.errors import require_integer, require_number
from jointsdf.evaluation.protocol import Protocol
from jointsdf.experiment.config_checks import check_settings, number_keys
from jointsdf.experiment.data_settings import counts, sample_settings
from jointsdf.experiment.settings import resolve, settings_errors
from jointsdf.experiment.tensorboard import preview_settings
from jointsdf.extraction.extractor import Extraction
from jointsdf.extraction.resolution import LADDER, resolution_for
from jointsdf.geometry.mesh import relative_area
from jointsdf.model.field import JointField
from jointsdf.shapes.clouds.report import CloudReport, cloud_report
from jointsdf.shapes.loading import LabelRequest
from jointsdf.shapes.mesh_report import MeshReport, mesh_report
from jointsdf.shapes.readers.step import Tessellation
from jointsdf.shapes.stored import load_configured
from jointsdf.shapes.units import choose_unit
from jointsdf.training.fit import FitMachine
from jointsdf.training.matrix_products import CHOICES, Products
from jointsdf.training.module import JointSDFModule
from jointsdf.training.random_state import seeded
from jointsdf.training.settings import FitSettings, Objective
from jointsdf.values import ASSUMED_UNIT, UNMOVED, LabelledPoints, Normalisation, Scan, Subject

FIT_KEYS = ("max_steps", "head_lr", "clip", "cosine", "warmup", "log_every", "refit")
STAND_IN_PARTS = np.arange(2)  # part ids of a field that is built for its checks alone


@dataclass(frozen=True)
class Measures:
    """Extraction of a field's mesh, and protocols that score it.

    Attributes:
        extraction: Field -> mesh.
        protocols: Mesh -> scores, by name.
    """

    extraction: Extraction
    protocols: Mapping[str, Protocol]


def check_config(cfg: DictConfig) -> None:
    """Refuse a config with a value out of range, by building all components that need no shape.

    Real numbers of the config become floats, so that 10 and 10.0 are the same config.

    Raises:
        InputError: A value out of range; the first one, and the accepted ones.
    """
    settings = resolve(cfg)
    check_settings(settings)
    for key in number_keys(settings):
        OmegaConf.update(cfg, key, float(OmegaConf.select(cfg, key)))
    Tessellation(**cfg.tessellation)
    LabelRequest(cfg.labels, cfg.num_parts)
    choose_unit(str(cfg.shape), ASSUMED_UNIT, str(cfg.unit))
    if cfg.trainer.full_rate_area is not None:
        require_number("trainer.full_rate_area", cfg.trainer.full_rate_area, 1e-6)
    with settings_errors("data"):
        counts(cfg), sample_settings(cfg), fit_machine(cfg), preview_settings(cfg)
        require_integer("data.workers", cfg.data.workers, 0, 256)
    with settings_errors("trunk, head, loss or optimizer"), seeded(0):
        trunk_init = {} if cfg.trunk.init != "sphere" else {"init": "siren"}  # fitting the sphere takes a second
        stand_in = _module(cfg, STAND_IN_PARTS, UNMOVED, 1.0, **trunk_init)
        stand_in.configure_optimizers()
    measures(cfg, LADDER[0] if cfg.extraction.resolution == "auto" else cfg.extraction.resolution)


def load_shape(cfg: DictConfig) -> Subject:
    """Load the mesh or the point cloud that the config names."""
    return load_configured(resolve(cfg))


def report_on(shape: Subject) -> MeshReport | CloudReport:
    """Measure what is fitted, before the fit."""
    return cloud_report(shape) if isinstance(shape, Scan) else mesh_report(shape)


def trunk_rate(cfg: DictConfig, shape: Subject, cloud: Callable[[], Cloud]) -> float:
    """Factor on the trunk's learning rates, below 1 on large surfaces, where the points of a step are sparser.

    Args:
        cfg: The composed config.
        shape: Ground truth; its area is used where the run knows the mesh.
        cloud: Draws the training cloud, from which the area is estimated otherwise.
    """
    full_rate_area = cfg.trainer.full_rate_area
    if full_rate_area is None:
        return 1.0
    area = relative_area(require_mesh(shape).mesh) if knows_mesh(cfg) else cloud().relative_area()
    return min(1.0, full_rate_area / area)


def first_resolution(cfg: DictConfig, wall: float, parts: Iterable[float] = ()) -> int:
    """Initial grid of the extraction: as configured, else from the thinnest wall and part, else the coarsest.

    Args:
        cfg: The composed config.
        wall: Thickness of the ground truth's thinnest wall, network length units; used where the run knows the mesh.
        parts: Width of each of its parts, network length units; the same.

    Returns:
        Grid points along each axis.
    """
    if cfg.extraction.resolution != "auto":
        return int(cfg.extraction.resolution)
    return resolution_for(wall, parts) if knows_mesh(cfg) else LADDER[0]


def knows_mesh(cfg: DictConfig) -> bool:
    """True if the run uses more of the mesh than points and labels."""
    return bool(cfg.data.distances == "mesh")


def measures(cfg: DictConfig, resolution: int) -> Measures:
    """Make extraction and protocols.

    Args:
        cfg: The composed config.
        resolution: Grid points of the extraction along each axis.

    Raises:
        InputError: A component refuses its settings.
    """
    with settings_errors("extraction"):
        extraction = instantiate(cfg.extraction, resolution=resolution)
    with settings_errors("evaluation"):
        return Measures(extraction, instantiate(cfg.evaluation.protocols, _convert_="all"))


def cloud_of(cfg: DictConfig, shape: Subject) -> Cloud:
    """Draw the training cloud."""
    return draw_cloud(shape, sample_settings(cfg), cfg.seed)


def labelled(cfg: DictConfig, shape: Subject, cloud: Cloud) -> LabelledPoints | None:
    """Draw the points to which the head's last layer is refitted; None where it is not."""
    return labelled_points(shape, cloud, sample_settings(cfg), cfg.seed) if cfg.trainer.refit else None


def data_and_module(
    cfg: DictConfig, shape: Subject, cloud: Cloud, rate: float
) -> tuple[ShapeDataModule, JointSDFModule]:
    """Make the stream of samples, and the field with its objective, initialised from the seed.

    Args:
        cfg: The composed config, checked.
        shape: Ground truth.
        cloud: From `cloud_of`.
        rate: From `trunk_rate`.

    Raises:
        InputError: A component refuses its settings.
    """
    with settings_errors("trunk, head, loss or optimizer"), seeded(cfg.seed):
        module = _module(cfg, cloud.part_ids, cloud.normalisation, rate)
        module.configure_optimizers()  # so that a bad rate is refused now, not in the fit
    with settings_errors("data"):
        sampler = prepare_samples(shape, cloud, counts(cfg), sample_settings(cfg), cfg.seed, module.field.far)
        data = ShapeDataModule(sampler, cfg.data.workers)
    return data, module


def _module(
    cfg: DictConfig, part_ids: Int[ndarray, " k"], normalisation: Normalisation, rate: float, **trunk: Any
) -> JointSDFModule:
    ids = part_ids if cfg.head.name != "none" else np.arange(0)
    field = JointField(resolve(cfg.trunk) | trunk, resolve(cfg.head), ids, normalisation)
    fit = FitSettings(seed=cfg.seed, trunk_rate=rate, **{key: cfg.trainer[key] for key in FIT_KEYS})
    return JointSDFModule(field, Objective(**instantiate(cfg.loss, _convert_="all")), instantiate(cfg.optimizer), fit)


def fit_machine(cfg: DictConfig) -> FitMachine:
    """Device, matrix products, checkpoint interval and logger of the fit."""
    products = Products(**{key: cfg.trainer[key] for key in CHOICES})
    return FitMachine(products, cfg.trainer.accelerator, cfg.trainer.checkpoint_seconds, cfg.logger.name)
