"""Draws from torch's default generator as a function of a seed alone."""

from collections.abc import Iterator
from contextlib import contextmanager

import torch


@contextmanager
def seeded(seed: int, device: torch.device | None = None) -> Iterator[None]:
    """Seed torch's default generator within the block, and restore its state afterwards.

    Initialisations and dropout draw from that generator alone.

    Args:
        seed: Any integer.
        device: A GPU whose generator is seeded as well.

    >>> with seeded(0): first = torch.rand(2)
    >>> with seeded(0): torch.equal(torch.rand(2), first)
    True
    """
    gpus = [device] if device is not None and device.type == "cuda" else []
    with torch.random.fork_rng(devices=gpus):
        torch.manual_seed(seed)
        yield
