"""Built-in parts, their samples and fields, made as a run makes them."""

import tempfile
from dataclasses import replace
from pathlib import Path

from hydra import compose, initialize_config_dir
from omegaconf import DictConfig

from jointsdf.data.datamodule import ShapeDataModule
from jointsdf.experiment import build
from jointsdf.threads import large_pieces
from jointsdf.training.fit import fit
from jointsdf.training.matrix_products import Products
from jointsdf.training.module import JointSDFModule
from jointsdf.training.product_choice import choose_products
from jointsdf.values import LabelledMesh, Shape

CONF = Path(__file__).parents[1] / "conf"
QUIET = ("trainer.accelerator=cpu", "trainer.preview_every=0", "trainer.checkpoint_seconds=1e9")


def composed(*overrides: str) -> DictConfig:
    """The config of a run on the CPU without previews."""
    with initialize_config_dir(str(CONF), version_base="1.3"):
        cfg = compose("config", overrides=[*QUIET, *overrides])
    build.check_config(cfg)
    return cfg


def built(cfg: DictConfig, mesh: LabelledMesh | None = None) -> tuple[Shape, ShapeDataModule, JointSDFModule]:
    """Ground truth, samples and untrained field of a run.

    Args:
        cfg: From `composed`.
        mesh: Closed, instead of the config's shape.
    """
    shape = build.load_shape(cfg)
    if mesh is not None:
        shape = replace(shape, name="mesh", mesh=mesh)
    cloud = build.cloud_of(cfg, shape)
    return shape, *build.data_and_module(cfg, shape, cloud, build.trunk_rate(cfg, shape, lambda: cloud))


@large_pieces()
def fitted(cfg: DictConfig, mesh: LabelledMesh | None = None) -> tuple[Shape, JointSDFModule]:
    """Ground truth and trained field of a run."""
    shape, data, module = built(cfg, mesh)
    with tempfile.TemporaryDirectory() as folder:
        fit(module, data, Path(folder), build.fit_machine(cfg), labelled=build.labelled(cfg, shape, data.sampler.cloud))
    return shape, module


def measured(cfg: DictConfig, module: JointSDFModule) -> Products:
    """Choose how a run's matrices are multiplied on this machine."""
    return choose_products(build.fit_machine(cfg).products, module.sizes)[0]
