"""Random draws of torch's default generator, as a function of a seed alone."""

from collections.abc import Iterator
from contextlib import contextmanager

import torch


@contextmanager
def seeded(seed: int, device: torch.device | None = None) -> Iterator[None]:
    """Within the block torch's default generator starts from the seed; afterwards it is as it was before.

    Initialisations and dropout draw from that generator and take no other.

    Args:
        seed: Any integer.
        device: Whose generator is seeded beside the CPU's, where it is a GPU.
    """
    gpus = [device] if device is not None and device.type == "cuda" else []
    with torch.random.fork_rng(devices=gpus):
        torch.manual_seed(seed)
        yield
