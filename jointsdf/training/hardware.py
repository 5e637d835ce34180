"""What memory the process keeps on its machine, and how much it took."""

import ctypes
import resource
import sys
from pathlib import Path

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3  # of mallopt, from glibc's malloc.h
KEPT_FREE, LARGEST_KEPT = 1 << 30, 1 << 25  # bytes: free memory kept in all; the largest piece that is reused
STATUS, RESET = Path("/proc/self/status"), Path("/proc/self/clear_refs")


def reset_peak_memory() -> None:
    """Start counting the peak anew, where the system can (Linux)."""
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


def keep_freed_memory(most: int = KEPT_FREE) -> bool:
    """Have memory that a step frees wait for the next step instead of going back to the system (glibc alone).

    By its own rule glibc returns it, and every page comes back through a page fault: about a sixth of a step at the
    size of `fast` on a virtual machine.

    Args:
        most: Bytes that may wait; more goes back.

    Returns:
        Whether it could be arranged.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    limits = ((M_MMAP_THRESHOLD, LARGEST_KEPT), (M_TRIM_THRESHOLD, most))
    return mallopt is not None and all(mallopt(what, value) == 1 for what, value in limits)
