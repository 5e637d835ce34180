"""Training clouds and samplers of shapes."""

import numpy as np
import torch
import trimesh

from jointsdf.data.point_cloud import Cloud
from jointsdf.data.sample_settings import SampleSettings
from jointsdf.data.sampler import Counts, Sampler
from jointsdf.data.samples import draw_cloud, prepare_samples
from jointsdf.values import LabelledMesh, Samples, Shape

COUNTS = Counts(manifold=300, non_manifold=200, shell=250, pool=150)


def cloud_of(solid: trimesh.Trimesh, count: int = 20000) -> Cloud:
    """So many points, uniform by area."""
    mesh = LabelledMesh(np.array(solid.vertices), np.array(solid.faces), np.zeros(len(solid.faces), dtype=np.int64))
    return Cloud.of(mesh, count=count, seed=0)


def sampler_of(shape: Shape, counts: Counts, *, seed: int = 0, **settings: object) -> Sampler:
    """As a run makes it."""
    chosen = SampleSettings(**{"cloud_size": 2000, "pool_size": 3000, **settings})
    return prepare_samples(shape, draw_cloud(shape, chosen, seed), counts, chosen, seed)


def same_samples(a: Samples, b: Samples) -> bool:
    """Bit by bit."""
    return all(torch.equal(x, y) for x, y in zip(a, b, strict=True))


def in_file_units(cloud: Cloud, points: torch.Tensor) -> np.ndarray:
    """Points of the network frame."""
    return cloud.normalisation.inverse(points.double().numpy())
