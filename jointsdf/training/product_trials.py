"""Timed comparisons of ways to multiply matrices with torch's float32 products, at the fit's own sizes.

An alternative is taken only if it is accurate enough and faster by `MIN_SPEEDUP` in each of `REPEATS` repeats side by
side. A processor's features say nothing about its speed: without bfloat16 instructions it emulates such products,
hundreds of times slower than float32.
"""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import torch
from torch import Tensor

from jointsdf.optimizers import ITERATIONS, orthogonalise
from jointsdf.training.matrix_products import (
    CHOICES,
    FLOAT32_ERROR,
    Products,
    Sizes,
    matmul,
    random_matrix,
    relative_error,
)

REPEATS, MIN_SPEEDUP = 5, 1.3
RUNS_PER_REPEAT = 3  # of each side, of which the fastest counts: others may use the machine as well
BFLOAT16_ERROR = 2e-2  # largest relative error accepted; bfloat16 gives 3e-3
BFLOAT16_INSTRUCTIONS = ("avx512_bf16", "amx_bf16", "avx10_2")  # of x86; without any of them bfloat16 is emulated


@dataclass(frozen=True)
class Trial:
    """A comparison of an alternative with torch's float32 products.

    Attributes:
        error: Relative error against float64.
        ratios: Speedup in each repeat; the first one below `MIN_SPEEDUP` is the last.
    """

    error: float
    ratios: tuple[float, ...]

    def passed(self, max_error: float) -> bool:
        """True if the alternative is accurate enough and was faster in every repeat."""
        return self.error < max_error and len(self.ratios) == REPEATS and min(self.ratios) >= MIN_SPEEDUP


RunTrial = Callable[
    [str, Products], Trial
]  # (key of CHOICES, products chosen so far) -> trial of the key's alternative


def choose_by_trials(capabilities: Mapping[str, Any], run_trial: RunTrial) -> tuple[Products, dict[str, Trial]]:
    """Choose, for each key of `CHOICES`, the alternative if its trial passes.

    Args:
        capabilities: Features of the processor, as `torch.cpu.get_capabilities` names them.
        run_trial: Compares one alternative; not called for products that the processor emulates.

    Returns:
        The choice, and the trials made for it by key.
    """
    products, trials = Products(), {}
    for key, (_, alternative) in CHOICES.items():
        if alternative == "bfloat16" and emulates_bfloat16(capabilities):
            continue
        trials[key] = run_trial(key, products)
        if trials[key].passed(BFLOAT16_ERROR if alternative == "bfloat16" else FLOAT32_ERROR):
            products = replace(products, **{key: alternative})
    return products, trials


def emulates_bfloat16(capabilities: Mapping[str, Any]) -> bool:
    """True if this processor is known to have no instructions for bfloat16 products.

    >>> emulates_bfloat16({"architecture": "x86_64", "avx2": True})
    True
    """
    x86 = capabilities.get("architecture") in ("x86_64", "amd64", "AMD64")
    return x86 and not any(capabilities.get(name) for name in BFLOAT16_INSTRUCTIONS)


def measure_speedups(
    usual: Callable[[], object], alternative: Callable[[], object], *, clock: Callable[[], float] = time.perf_counter
) -> tuple[float, ...]:
    """Speedup of the alternative in each repeat, both sides in turns; ends at the first one below `MIN_SPEEDUP`.

    Args:
        usual: The product in use.
        alternative: The product that may replace it.
        clock: Time in seconds.
    """

    def seconds(product: Callable[[], object]) -> float:
        taken = []
        for _ in range(RUNS_PER_REPEAT):
            start = clock()
            product()
            taken.append(clock() - start)
        return min(taken)

    usual()  # the first call prepares what the others use
    alternative()
    ratios: list[float] = []
    while len(ratios) < REPEATS and (not ratios or ratios[-1] >= MIN_SPEEDUP):
        ratios.append(seconds(usual) / seconds(alternative))
    return tuple(ratios)


def trials_of_sizes(sizes: Sizes) -> RunTrial:
    """Make the function that compares products of these sizes on this machine."""
    width, gpu = sizes.width, sizes.device.type == "cuda"
    values, other, weights = (random_matrix(n, width).to(sizes.device) for n in (sizes.points, sizes.points, width))
    hidden = random_matrix(sizes.matrices * width, width).to(sizes.device).view(-1, width, width)

    def backward(dtype: torch.dtype) -> Tensor:
        """Backward products of a layer: the adjoint of the layer before, and the gradient of the weights."""
        low = values.to(dtype)
        return torch.cat([low @ weights.to(dtype), low.T @ other.to(dtype)]).to(torch.promote_types(dtype, torch.float))

    def orthogonalisation(dtype: torch.dtype) -> Tensor:
        return orthogonalise(hidden.to(torch.promote_types(dtype, torch.float)), ITERATIONS["five"][:1], dtype)

    def run_trial(key: str, products: Products) -> Trial:
        if key == "matmul" and gpu:
            return Trial(math.inf, ())  # a library of the CPU
        product = orthogonalisation if key == "orthogonalisation" else backward
        low = torch.float32 if key == "matmul" else torch.bfloat16

        def multiply(dtype: torch.dtype, library: str) -> Tensor:
            with matmul(library):
                found = product(dtype)
            if gpu:
                torch.cuda.synchronize(sizes.device)
            return found

        usual = partial(multiply, torch.float32, products.matmul)
        alternative = partial(multiply, low, "onednn" if key == "matmul" else products.matmul)
        return Trial(relative_error(alternative(), product(torch.float64)), measure_speedups(usual, alternative))

    return run_trial
