"""Memory of the process: its peak, and reuse of freed memory instead of its return to the system."""

import ctypes
import resource
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3  # of mallopt, from glibc's malloc.h
KEPT_FREE, LARGEST_KEPT = 1 << 30, 1 << 25  # bytes: free memory kept in all; largest block that is reused
DEFAULT_THRESHOLD = 128 * 1024  # glibc's M_MMAP_THRESHOLD and M_TRIM_THRESHOLD, from mallopt(3)
STATUS, RESET = Path("/proc/self/status"), Path("/proc/self/clear_refs")


def reset_peak_memory() -> None:
    """Reset the peak, where the system can (Linux)."""
    try:
        RESET.write_text("5")
    except OSError:
        return


def peak_memory_mb() -> float:
    """Largest resident memory since the last reset, MiB; since the start of the process where it cannot be reset."""
    try:
        line = next(line for line in STATUS.read_text().splitlines() if line.startswith("VmHWM"))
        return round(int(line.split()[1]) / 1024, 1)
    except (OSError, StopIteration):
        return round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, 1)


@contextmanager
def freed_memory_kept(most: int = KEPT_FREE) -> Iterator[bool]:
    """Keep memory that a step frees for the next step within the block, by glibc's `mallopt`.

    By default glibc returns it to the system, and every page comes back through a page fault: about a sixth of a step
    at the size of `fast` on a virtual machine. Afterwards glibc's thresholds are those it starts with. Without glibc
    nothing happens.

    Args:
        most: Largest amount of free memory kept, bytes.

    Yields:
        Whether glibc accepted the thresholds.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if mallopt is None:
        yield False
        return
    kept = mallopt(M_MMAP_THRESHOLD, LARGEST_KEPT) == 1 and mallopt(M_TRIM_THRESHOLD, most) == 1
    try:
        yield kept
    finally:
        mallopt(M_MMAP_THRESHOLD, DEFAULT_THRESHOLD)
        mallopt(M_TRIM_THRESHOLD, DEFAULT_THRESHOLD)
