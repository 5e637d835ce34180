"""The stream of training samples of one shape."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from lightning import LightningDataModule
from torch.utils.data import DataLoader, IterableDataset, get_worker_info

from jointsdf.cloud import Cloud, pool_points
from jointsdf.distance import ExactDistance
from jointsdf.free_space import FreeSpace
from jointsdf.sampling import Counts, Sampler
from jointsdf.surfels import Surfels
from jointsdf.values import InputError, Normalisation, Samples, Shape


def network_distance(shape: Shape, normalisation: Normalisation) -> ExactDistance:
    """The exact signed distance of a shape, asked and answered in the network frame."""
    vertices = normalisation.forward(shape.mesh.vertices)
    return ExactDistance(replace(shape.mesh, vertices=vertices), watertight=shape.watertight)


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
            points = self.cloud.points[: self.cloud.uniform]
            surfels = Surfels(points, FreeSpace(points))
            known, where = surfels.signed(pool)
            pool, known = pool[where], known[where]
            normals = np.zeros_like(self.cloud.normals)
            normals[: self.cloud.uniform] = surfels.normals
            self.cloud = replace(self.cloud, normals=normals)
            if pool_size and not len(pool):
                raise InputError(
                    f"data.distances=cloud: {cloud_size} points leave no free space in the box; "
                    "use a larger data.cloud_size, or data.distances=mesh"
                )
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
