"""Lightning data module: an endless stream of training samples, one batch per step."""

from collections.abc import Iterator

import torch
from lightning import LightningDataModule
from torch.utils.data import DataLoader, IterableDataset, get_worker_info

from jointsdf.data.sampler import Sampler
from jointsdf.values import Samples


class StepStream(IterableDataset[Samples]):
    """Samples of step `start`, `start + 1`, ...: the same for any number of workers.

    Args:
        sampler: Draws one step.
        start: First step, so that a resumed run continues where it stopped.
    """

    def __init__(self, sampler: Sampler, start: int) -> None:
        super().__init__()
        self.sampler, self.start = sampler, start

    def __iter__(self) -> Iterator[Samples]:
        """Every step from `start` on, without end; n workers yield every n-th each, interleaved by the loader."""
        worker = get_worker_info()
        step, stride = (self.start, 1) if worker is None else (self.start + worker.id, worker.num_workers)
        while True:
            yield self.sampler.draw(step)
            step += stride


class ShapeDataModule(LightningDataModule):
    """Streams the samples of every step to the trainer.

    Args:
        sampler: Draws one step.
        workers: Processes that draw samples; 0 draws in the training process. Any number gives the same samples.
    """

    def __init__(self, sampler: Sampler, workers: int = 0) -> None:
        super().__init__()
        self.sampler, self.workers = sampler, workers

    def train_dataloader(self) -> DataLoader[Samples]:
        """Stream from the trainer's current step on."""
        start = self.trainer.global_step if self.trainer else 0
        return DataLoader(
            StepStream(self.sampler, start),
            batch_size=None,
            num_workers=self.workers,
            generator=torch.Generator(),  # seeds the workers, which draw nothing from it; spares the process's own
            persistent_workers=self.workers > 0,
        )
