"""Data parallelism over points in a few large pieces, one thread each: threads meet once a pass.

OpenMP starts a parallel region for every product and every sine, where all threads spin until the slowest is done; on a
busy machine the slowest is late every time. Here a thread takes a piece through all layers with operations of one
thread, and then the next piece.
"""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from threading import Barrier
from typing import TypeVar

import torch
from torch import Tensor

MAX_PIECE_POINTS, MIN_PIECE_POINTS = 1300, 250  # more do not stay in cache, fewer are not worth the calls

In = TypeVar("In")
Out = TypeVar("Out")
_workers: list[int] = []  # one entry per nested block of `large_pieces`, the innermost last


def workers() -> int:
    """Number of threads that share the pieces: torch's threads per operation, within `large_pieces` those before it."""
    return _workers[-1] if _workers else torch.get_num_threads()


@contextmanager
def large_pieces() -> Iterator[None]:
    """Within the block, give each operation one thread, and pieces of work all threads that operations had before."""
    before = torch.get_num_threads()
    _workers.append(workers())
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
        _workers.pop()


def pieces(points: Tensor, most: int | None = None) -> int:
    """Number of pieces to split the points into: a multiple of the threads where pieces are large enough; 1 on a GPU.

    Args:
        points: One row each.
        most: Points of one piece; `MAX_PIECE_POINTS` by default.

    >>> pieces(torch.zeros(100, 3)), pieces(torch.zeros(0, 3))
    (1, 1)
    """
    if points.is_cuda or len(points) == 0:
        return 1
    count = -(-len(points) // (most or MAX_PIECE_POINTS))
    return max(count, min(-(-count // workers()) * workers(), len(points) // MIN_PIECE_POINTS))


def over_threads(function: Callable[[In], Out], items: Iterable[In]) -> list[Out]:
    """Parallel `[function(item) for item in items]` on all threads, without recording gradients.

    Args:
        function: May call torch; its operations take one thread each.
        items: Taken in order by the next free thread.

    >>> over_threads(abs, [-1, 2])
    [1, 2]
    """
    items = list(items)
    with torch.no_grad():
        if workers() == 1 or len(items) < 2:
            return [function(item) for item in items]
        return list(_pool(workers()).map(function, items))


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    """Make a pool of threads, each with operations of one thread."""
    started, before = Barrier(threads), torch.get_num_threads()

    def prepare_thread() -> None:
        torch.set_grad_enabled(False)
        torch.get_num_threads()  # the first call makes a thread take the process's number, once
        torch.set_num_threads(1)
        started.wait()

    pool = ThreadPoolExecutor(threads, "jointsdf")
    for task in [pool.submit(prepare_thread) for _ in range(threads)]:
        task.result()
    torch.set_num_threads(before)  # later threads begin with what one thread sets
    return pool
