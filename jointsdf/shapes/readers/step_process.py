"""The CAD kernel on one STEP file, in a process of its own with limits of time and memory."""

import io
import logging
import os
import re
import resource
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy import ndarray

from jointsdf.errors import InputError

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Limits:
    """What the kernel may take for one file; a sound one takes two seconds per megabyte.

    Attributes:
        seconds: For a file of any size.
        seconds_per_megabyte: More, for a large one.
        most_seconds: In all.
        memory: Bytes of its address space.
        memory_share: Of the machine's memory, where that is less.
    """

    seconds: float = 60.0
    seconds_per_megabyte: float = 60.0
    most_seconds: float = 600.0
    memory: int = 8 << 30
    memory_share: float = 0.75

    def seconds_for(self, size: int) -> float:
        """Seconds for a file of so many bytes."""
        return min(self.most_seconds, self.seconds + self.seconds_per_megabyte * size / 1e6)

    def bytes_here(self) -> int:
        """Bytes on this machine, under the limit of this process (`ulimit -v`) where that is less."""
        machine = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
        granted = [limit for limit in resource.getrlimit(resource.RLIMIT_AS) if limit != resource.RLIM_INFINITY]
        return min(self.memory, int(self.memory_share * machine), *granted)


LIMITS = Limits()


def run_worker(
    path: Path, data: bytes, tolerance: float, angle: float, limits: Limits | None = None
) -> dict[str, ndarray]:
    """Run `step_worker.py` on a file; see there for its arrays.

    Args:
        path: Names the file in messages.
        data: Its content.
        tolerance: Largest distance from the surface, relative to the longest side of the whole file.
        angle: Largest angle between neighbouring chords, radians.
        limits: Of time and memory; `LIMITS` without.

    Raises:
        InputError: The kernel cannot read the file, finds no surface, crashes, or needs more than its limits.
    """
    limits = limits or LIMITS
    seconds, memory = limits.seconds_for(len(data)), limits.bytes_here()
    script = str(Path(__file__).with_name("step_worker.py"))
    command = [sys.executable, "-P", script, str(tolerance), str(angle), str(memory)]
    try:
        done = subprocess.run(command, input=data, capture_output=True, check=False, timeout=seconds)
    except subprocess.TimeoutExpired:
        raise InputError(
            f"{path} takes the CAD kernel more than {seconds:.0f} s: it is damaged or too large; export it again, or "
            "as a triangle mesh"
        ) from None
    messages = re.sub(r"\x1b\[[\d;]*m", "", done.stderr.decode("utf-8", errors="replace"))
    if done.returncode != 0 and re.search("MemoryError|bad_alloc|OutOfMemory", messages):
        raise InputError(
            f"{path} takes the CAD kernel more than {memory / 2**30:.2g} GiB: it is damaged or too large; export it "
            "again, or as a triangle mesh"
        )
    if done.returncode > 0:
        last = (messages.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
        raise InputError(f"{path} cannot be tessellated: {last}; export it again")
    if done.returncode < 0:
        raise InputError(
            f"{path} is damaged: the STEP reader crashed on it (signal {-done.returncode}); export it again"
        )
    if not done.stdout:
        raise InputError(f"{path} is damaged or holds no surface: nothing could be read from it; export it again")
    if "Fails Count" in messages:
        logger.warning("%s: damaged in places (syntax or references): some surfaces may be missing", path)
    with np.load(io.BytesIO(done.stdout), allow_pickle=False) as arrays:
        return dict(arrays)
