"""The stream of training samples of one shape."""

import logging
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from lightning import LightningDataModule
from numpy import ndarray
from torch.utils.data import DataLoader, IterableDataset, get_worker_info

from jointsdf.data.point_cloud import Cloud, pool_points
from jointsdf.data.sampler import Counts, Sampler
from jointsdf.data.surfels import Surfels
from jointsdf.errors import InputError
from jointsdf.geometry.distance import ExactDistance
from jointsdf.values import Normalisation, Samples, Shape

log = logging.getLogger(__name__)


def network_distance(shape: Shape, normalisation: Normalisation) -> ExactDistance:
    """The exact signed distance of a shape, asked and answered in the network frame."""
    vertices = normalisation.forward(shape.mesh.vertices)
    return ExactDistance(replace(shape.mesh, vertices=vertices), watertight=shape.watertight)


def told_by_cloud(
    cloud: Cloud, pool: Float[ndarray, "p 3"]
) -> tuple[Cloud, Float[ndarray, "q 3"], Float[ndarray, " q"]]:
    """The cloud with the normals that its uniform points tell, and the pool points whose signed distance they tell.

    Args:
        cloud: Whose normals are not looked at; points beyond the uniform ones get none.
        pool: Where distances are wanted, network frame.

    Raises:
        InputError: They tell no distance at all.
    """
    surfels = Surfels(cloud.points[: cloud.uniform])
    normals = np.zeros_like(cloud.normals)
    normals[: cloud.uniform] = surfels.normals
    distances, told = surfels.signed(pool)
    if len(pool) and not told.any():
        raise InputError(
            f"data.distances=cloud: {cloud.uniform} points leave no free space in the box; "
            "use a larger data.cloud_size, or data.distances=mesh"
        )
    shares = surfels.normals.any(axis=1).mean(), told.mean() if len(pool) else 0.0
    log.info(
        "the cloud tells the normals of %.0f%% of its points, and %.0f%% of the distances", *(100 * x for x in shares)
    )
    return replace(cloud, normals=normals), pool[told], distances[told]


class StepStream(IterableDataset[Samples]):
    """The samples of step `start`, `start + 1`, ...: the same for any number of workers.

    Args:
        sampler: Draws one step.
        start: First step, so that a resumed run goes on where it was.
    """

    def __init__(self, sampler: Sampler, start: int) -> None:
        super().__init__()
        self.sampler, self.start = sampler, start

    def __iter__(self) -> Iterator[Samples]:
        """Every step from `start` on, without end; worker w of n yields every n-th, which the loader interleaves."""
        worker = get_worker_info()
        step, stride = (self.start, 1) if worker is None else (self.start + worker.id, worker.num_workers)
        while True:
            yield self.sampler.draw(step)
            step += stride


class ShapeDataModule(LightningDataModule):
    """Prepares one shape's cloud and pool, and streams its steps.

    Args:
        shape: Ground truth.
        counts: Points per step.
        seed: Of the run.
        cloud_size: Points of the training cloud.
        pool_size: Points with known signed distance; 0 where no term uses them.
        distances: Where those and the normals come from: `mesh`, exact; `cloud`, the uniform points of the cloud alone,
            where they leave no doubt.
        pool_near: Share of the pool near the surface; the rest is uniform in the box.
        region_points: Points of the cloud spread over the smooth regions, beyond `cloud_size`.
        border_points: Points of the cloud near part borders, beyond `cloud_size`.
        label_fraction: Share of the cloud that keeps its labels.
        workers: Processes that draw samples; 0 draws in the training process.

    Raises:
        InputError: A negative size or number of workers, an unknown source of distances, or a cloud that gives none.
    """

    def __init__(
        self,
        shape: Shape,
        counts: Counts,
        *,
        seed: int,
        cloud_size: int,
        pool_size: int,
        distances: str = "mesh",
        pool_near: float = 0.5,
        region_points: int = 0,
        border_points: int = 0,
        label_fraction: float = 1.0,
        workers: int = 0,
    ) -> None:
        super().__init__()
        sizes = {"pool_size": pool_size, "region_points": region_points, "border_points": border_points}
        for name, value in (sizes | {"workers": workers}).items():
            if value < 0:
                raise InputError(f"data.{name}={value}: must be at least 0")
        if distances not in ("mesh", "cloud"):
            raise InputError(f"data.distances={distances}: accepted are mesh, cloud")
        if not 0 <= pool_near <= 1:
            raise InputError(f"data.pool_near={pool_near}: must be between 0 and 1")
        self.workers = workers
        self.cloud = Cloud.of(
            shape.mesh,
            count=cloud_size,
            seed=seed,
            label_fraction=label_fraction,
            region_points=region_points,
            border_points=border_points,
        )
        pool = pool_points(self.cloud, count=pool_size, near_share=pool_near, seed=seed)
        if distances == "mesh":
            known = network_distance(shape, self.cloud.normalisation).signed(pool)
        else:
            self.cloud, pool, known = told_by_cloud(self.cloud, pool)
        self.sampler = Sampler(self.cloud, pool, known, counts, seed)

    def train_dataloader(self) -> DataLoader[Samples]:
        """The stream from the trainer's current step on."""
        start = self.trainer.global_step if self.trainer else 0
        return DataLoader(
            StepStream(self.sampler, start),
            batch_size=None,
            num_workers=self.workers,
            persistent_workers=self.workers > 0,
        )
