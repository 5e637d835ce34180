"""Training clouds of solids."""

import numpy as np
import trimesh

from jointsdf.cloud import Cloud
from jointsdf.values import LabelledMesh


def cloud_of(solid: trimesh.Trimesh, count: int = 20000) -> Cloud:
    """So many points, uniform by area."""
    mesh = LabelledMesh(np.array(solid.vertices), np.array(solid.faces), np.zeros(len(solid.faces), dtype=np.int64))
    return Cloud.of(mesh, count=count, seed=0)
