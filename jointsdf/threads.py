"""Work over points in a few large pieces, one thread each: threads meet once a pass, not once an operation.

OpenMP's own way, a parallel region for every product and every sine, has all threads wait for the slowest at each, and
spin while they wait. On a machine that does something else as well the slowest is late every time. Here a thread takes
a piece through all layers with operations of one thread, and whoever is done takes the next piece.
"""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from threading import Barrier
from typing import TypeVar

import torch
from torch import Tensor

MOST, LEAST = 1300, 250  # points of a piece: more do not stay in cache, fewer are not worth the calls

In = TypeVar("In")
Out = TypeVar("Out")
_workers: list[int] = []  # the innermost block's last


def workers() -> int:
    """How many threads share the pieces: as many as torch takes for an operation, or took before `large_pieces`."""
    return _workers[-1] if _workers else torch.get_num_threads()


@contextmanager
def large_pieces() -> Iterator[None]:
    """Within the block, operations take one thread, and pieces of work take all that operations took before."""
    before = torch.get_num_threads()
    _workers.append(workers())
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
        _workers.pop()


def pieces(points: Tensor) -> int:
    """Into how many pieces to cut so many points: as many for each thread; one on a GPU."""
    if points.is_cuda or len(points) == 0:
        return 1
    count = -(-len(points) // MOST)
    return max(count, min(-(-count // workers()) * workers(), len(points) // LEAST))


def over_threads(function: Callable[[In], Out], items: Iterable[In]) -> list[Out]:
    """`[function(item) for item in items]` on all threads, none of them recording gradients.

    Args:
        function: May call torch; its operations take one thread each.
        items: In their order; whichever thread is free takes the next.
    """
    items = list(items)
    with torch.no_grad():
        if workers() == 1 or len(items) < 2:
            return [function(item) for item in items]
        return list(_pool(workers()).map(function, items))


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    """So many waiting threads, each with operations of one thread."""
    started, before = Barrier(threads), torch.get_num_threads()

    def alone() -> None:
        torch.set_grad_enabled(False)
        torch.get_num_threads()  # the first question makes a thread take the process's number, once
        torch.set_num_threads(1)
        started.wait()

    pool = ThreadPoolExecutor(threads, "jointsdf")
    for task in [pool.submit(alone) for _ in range(threads)]:
        task.result()
    torch.set_num_threads(before)  # what one thread sets is what later ones begin with
    return pool
