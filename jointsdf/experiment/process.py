"""Settings of the whole process during a run: allocator, library of matrix products, peak of memory."""

from collections.abc import Iterator
from contextlib import contextmanager

from jointsdf.training.hardware import freed_memory_kept, reset_peak_memory
from jointsdf.training.matrix_products import matmul_restored


@contextmanager
def process_settings() -> Iterator[None]:
    """Reset the peak of memory, keep freed memory within the block, and restore allocator and library afterwards."""
    reset_peak_memory()
    with freed_memory_kept(), matmul_restored():
        yield
