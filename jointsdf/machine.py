"""What the process uses of its machine: how it multiplies matrices, what memory it keeps and how much it took."""

import ctypes
import resource
import sys
from pathlib import Path
from typing import Any

import torch

MATMUL_ERROR = 1e-6  # relative; float32 gives 2e-7, bfloat16 2e-3
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


def choose_matmul(wanted: str) -> str:
    """Set how float32 matrices are multiplied on the CPU, and give the name of what is used from here on.

    On AMD processors with AVX-512, torch's default library takes its slow path, and oneDNN is up to twice as fast.
    The switch that leads there permits bfloat16 by its name, so the products are compared with float64 first.

    Args:
        wanted: `default`, `onednn` where it gives float32 accuracy, or `auto`: onednn on such processors.
    """
    capabilities = torch.cpu.get_capabilities()
    slow_default = "AMD" in str(capabilities.get("cpu_name")) and capabilities.get("avx512_f", False)
    mkldnn: Any = torch.backends.mkldnn
    mkldnn.matmul.fp32_precision = "none"
    if wanted == "default" or (wanted == "auto" and not slow_default) or not mkldnn.is_available():
        return "default"
    mkldnn.matmul.fp32_precision = "bf16"
    if _product_error() < MATMUL_ERROR:
        return "onednn"
    mkldnn.matmul.fp32_precision = "none"
    return "default"


def choose_backward(wanted: str, *, gpu: bool) -> torch.dtype | None:
    """Precision of the trunk's backward matrix products; None: float32.

    Args:
        wanted: `float32`, `bfloat16`, or `auto`: bfloat16 where the processor multiplies it faster.
        gpu: Whether the fit runs on a CUDA device.
    """
    if wanted == "auto":
        capabilities = torch.cpu.get_capabilities()
        fast = (
            torch.cuda.is_bf16_supported() if gpu else capabilities.get("avx512_bf16") or capabilities.get("amx_bf16")
        )
        wanted = "bfloat16" if fast else "float32"
    return torch.bfloat16 if wanted == "bfloat16" else None


def _product_error() -> float:
    """Relative error of a float32 matrix product of a training step's size."""
    generator = torch.Generator().manual_seed(0)
    a, b = torch.randn(512, 256, generator=generator), torch.randn(256, 256, generator=generator)
    exact = a.double() @ b.double()
    return float((a @ b - exact).norm() / exact.norm())
