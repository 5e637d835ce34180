"""Memory that a step frees waits for the next step, whatever the size of the system's pages."""

import mmap
import platform
import subprocess
import sys

import pytest

from jointsdf.training.hardware import freed_memory_kept, peak_memory_mb, reset_peak_memory

STEPS = """
import sys, torch
from pathlib import Path
from jointsdf.training.hardware import freed_memory_kept

def resident():
    line = next(x for x in Path("/proc/self/status").read_text().splitlines() if x.startswith("VmRSS"))
    return int(line.split()[1]) // 1024

def step():
    return [torch.ones(20_000_000 // 4) for _ in range(10)]

def grown():
    before = resident()
    step()
    return resident() - before

if sys.argv[1] == "kept":
    with freed_memory_kept() as kept:
        assert kept
        print(grown())
elif sys.argv[1] == "afterwards":
    with freed_memory_kept():
        pass
    print(grown())
else:
    print(grown())
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="the allocator of glibc is set")
@pytest.mark.parametrize(("how", "kept"), [("kept", True), ("afterwards", False), ("as it is", False)])
def test_freed_memory_stays_with_the_process(how: str, kept: bool) -> None:
    """200 MB in pieces of 20, which glibc by its own rule gives back at once."""
    answer = subprocess.run([sys.executable, "-c", STEPS, how], capture_output=True, text=True, check=True)
    assert (int(answer.stdout) > 150) == kept, answer.stdout


@freed_memory_kept()
def test_the_peak_counts_from_its_reset() -> None:
    reset_peak_memory()
    before = peak_memory_mb()
    with mmap.mmap(-1, 64 << 20) as held:  # new pages, whatever the heap has kept
        held.write(b"x" * len(held))
    peak = peak_memory_mb()
    assert 60 < peak - before < 140
    reset_peak_memory()
    assert peak_memory_mb() < peak - 60, "and falls with the next reset"
