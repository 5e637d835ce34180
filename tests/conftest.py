"""Shapes of known distance and small fields, shared by the tests."""

import atexit
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator

import analytic
import jaxtyping
import numpy as np
import pytest
import torch
import trimesh

from jointsdf.model.field import JointField
from jointsdf.values import LabelledMesh, Normalisation, Shape

BOX_EXTENTS = np.array([40.0, 24.0, 16.0])  # file units
BOX_CENTRE = np.array([5.0, -3.0, 11.0])
BOX_PARTS = (3, 7, 12, 40)  # original ids, not contiguous
os.environ["XDG_CACHE_HOME"] = tempfile.mkdtemp()  # nothing that the user keeps is read or written
atexit.register(shutil.rmtree, os.environ["XDG_CACHE_HOME"], ignore_errors=True)
torch.set_num_threads(1)  # small tensors: two threads wait for each other, the longer the busier the machine
KNOBS: dict[str, dict[str, object]] = {  # of small heads
    "relu": {"widths": [16, 8], "dropout": 0.2},
    "siren": {"widths": [16, 8], "omega": 30.0},
    "hybrid": {"widths": [16, 8], "omega": 30.0, "dropout": 0.2},
    "deep_skip": {"widths": [16, 16, 16, 8], "omega": 30.0},
    "none": {},
}


@pytest.fixture
def box() -> LabelledMesh:
    """A box off the origin; its parts are split by the direction that a face looks."""
    solid = trimesh.creation.box(extents=BOX_EXTENTS)
    normals = np.array(solid.face_normals)
    labels = np.select([normals[:, 0] > 0.5, normals[:, 0] < -0.5, normals[:, 2] > 0.5], BOX_PARTS[:3], BOX_PARTS[3])
    return LabelledMesh(np.array(solid.vertices) + BOX_CENTRE, np.array(solid.faces), labels.astype(np.int64))


@pytest.fixture
def box_shape(box: LabelledMesh) -> Shape:
    """The box as a run meets it."""
    return Shape("box", box, "0" * 64, "builtin", True)


@pytest.fixture
def box_distance() -> Callable[[np.ndarray], np.ndarray]:
    """Exact signed distance to the box, file units."""

    def distance(points: np.ndarray) -> np.ndarray:
        return analytic.box_distance(points - BOX_CENTRE, BOX_EXTENTS / 2)

    return distance


@pytest.fixture
def small_field() -> Callable[..., JointField]:
    """Builds a field of a few units whose output layers are not near zero, so that every answer differs."""

    def build(
        head: str = "siren",
        part_ids: tuple[int, ...] = BOX_PARTS,
        *,
        normalisation: Normalisation | None = None,
        seed: int = 0,
        **trunk: float | str,
    ) -> JointField:
        torch.manual_seed(seed)
        field = JointField(
            {"width": 16, "depth": 3, "tap": 2, **trunk},
            {"name": head, **KNOBS[head]},
            np.array(part_ids if head != "none" else (), dtype=np.int64),
            normalisation or Normalisation(BOX_CENTRE, 25.0),
        )
        torch.nn.init.uniform_(field.trunk.output.weight, -0.3, 0.3)
        torch.nn.init.uniform_(field.trunk.output.bias, -0.1, 0.1)
        for parameter in list(field.head.parameters())[-2:]:
            torch.nn.init.uniform_(parameter, -1, 1)
        return field

    return build


@pytest.fixture
def as_in_training() -> Iterator[None]:
    """Run-time type checks off, as outside the tests: what a user types wrong reaches the code's own checks."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)
