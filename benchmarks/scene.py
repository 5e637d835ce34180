"""Built-in parts, their samples and fields, made as a run makes them."""

import tempfile
from dataclasses import replace
from pathlib import Path

import torch
from hydra import compose, initialize_config_dir
from omegaconf import DictConfig

from jointsdf.data.datamodule import ShapeDataModule
from jointsdf.experiment import build as assembly
from jointsdf.threads import large_pieces
from jointsdf.training.fit import fit
from jointsdf.training.matrix_products import Products, chosen
from jointsdf.training.module import JointSDFModule
from jointsdf.values import LabelledMesh, Shape

CONF = Path(__file__).parents[1] / "conf"
QUIET = ("trainer.accelerator=cpu", "trainer.preview_every=0")


def composed(*overrides: str) -> DictConfig:
    """The config of a run on the CPU without previews."""
    with initialize_config_dir(str(CONF), version_base="1.3"):
        cfg = compose("config", overrides=[*QUIET, *overrides])
    assembly.checked(cfg)
    return cfg


def built(cfg: DictConfig, mesh: LabelledMesh | None = None) -> tuple[Shape, ShapeDataModule, JointSDFModule]:
    """Ground truth, samples and untrained field of a run.

    Args:
        cfg: From `composed`.
        mesh: Closed, instead of the config's shape.
    """
    torch.manual_seed(cfg.seed)
    shape = assembly.load_shape(cfg)
    if mesh is not None:
        shape = replace(shape, name="mesh", mesh=mesh)
    return shape, *assembly.build(cfg, shape)


@large_pieces()
def fitted(cfg: DictConfig, mesh: LabelledMesh | None = None) -> tuple[Shape, JointSDFModule]:
    """Ground truth and trained field of a run."""
    shape, data, module = built(cfg, mesh)
    with tempfile.TemporaryDirectory() as folder:
        how = {"accelerator": "cpu", "checkpoint_seconds": 1e9, "log_every": cfg.trainer.log_every}
        fit(module, data, Path(folder), preview=None, products=assembly.products(cfg), **how)
    return shape, module


def measured(cfg: DictConfig, module: JointSDFModule) -> Products:
    """How a run's matrices are multiplied on this machine."""
    return chosen(assembly.products(cfg), module.sizes)[0]
