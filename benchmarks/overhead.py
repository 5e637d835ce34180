"""Overhead of a run over the bare step at the size of `fast`: Lightning's loop, drawing samples, logging.

The bare step is objective, backward, clip and optimizer on samples drawn beforehand. Both sides take as many steps; of
a run, the seconds of a shorter run are taken away, so that starting and ending does not count.
"""

import statistics
import tempfile
import time
from pathlib import Path

import torch

from benchmarks.fit import one_step
from benchmarks.scene import built, composed, measured
from benchmarks.table import Row, machine
from jointsdf.experiment import build
from jointsdf.threads import large_pieces
from jointsdf.training.fit import fit

TARGET = 0.05


def rows(steps: int = 100, repetitions: int = 3) -> list[Row]:
    """Seconds per step of a run and of the bare step.

    Args:
        steps: Timed on each side.
        repetitions: The medians are over so many.
    """
    with machine(torch.get_num_threads(), "default"), large_pieces():
        taken = [(run_seconds(steps), bare_seconds(steps)) for _ in range(repetitions)]
    run, bare = (statistics.median(side) for side in zip(*taken, strict=True))
    name = "Lightning, sampling and logging, share of a step"
    return [Row(name, "the bare step at the size of fast", run, bare, "s", run / bare - 1, TARGET, at_least=False)]


def run_seconds(steps: int) -> float:
    """Per step of a run: a long one less a short one."""
    short = max(steps // 10, 1)
    return (_fit_seconds(short + steps) - _fit_seconds(short)) / steps


def _fit_seconds(steps: int) -> float:
    cfg = composed(f"trainer.max_steps={steps}", "data.pool_size=20000")
    _, data, module = built(cfg)
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        fit(module, data, Path(folder), build.fit_machine(cfg))
        return time.perf_counter() - start


def bare_seconds(steps: int) -> float:
    """Per step of objective, backward, clip and optimizer, after as many steps as the short run has."""
    short = max(steps // 10, 1)
    cfg = composed(f"trainer.max_steps={short + steps}", "data.pool_size=20000")
    _, data, module = built(cfg)
    module.products = measured(cfg, module)
    samples = [data.sampler.draw(step) for step in range(short + steps)]
    optimizer = module.configure_optimizers()["optimizer"]
    module.train()
    start = 0.0
    for step in range(short + steps):
        if step == short:
            start = time.perf_counter()
        one_step(module, optimizer, samples[step], step)
    return (time.perf_counter() - start) / steps
