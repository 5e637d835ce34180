"""What the process uses of its machine."""

import resource
from pathlib import Path

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
