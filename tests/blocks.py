"""The configured protocols, and a block that they are tried on."""

from pathlib import Path

import numpy as np
import trimesh
from hydra.utils import instantiate
from omegaconf import OmegaConf

from jointsdf.values import LabelledMesh

CONFIG = OmegaConf.load(Path(__file__).parents[1] / "conf" / "evaluation" / "default.yaml")
PROTOCOLS = instantiate(CONFIG.protocols, _convert_="all")


def block(labels_split=0.0, size=1.0) -> LabelledMesh:
    """A 3 x 2 x 1 block, finely triangulated, away from the origin; labels 2 and 7 on either side of x = split."""
    box = trimesh.creation.box(extents=(3 * size, 2 * size, size)).subdivide().subdivide().subdivide().subdivide()
    labels = np.where(box.triangles_center[:, 0] > labels_split, 7, 2)
    return LabelledMesh(np.array(box.vertices) + np.array([10.0, 20.0, 30.0]), np.array(box.faces), labels)


TRUTH, OFF = block(), block(labels_split=0.2, size=1.02)
