"""The fit of `fast` on this kind of machine: seconds, its orthogonalisation, beside a busy process; and `smoke` whole.

Targets are of two cores, by whether the processor multiplies bfloat16 fast enough for the fit to take it.
"""

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import torch
from torch.nn.utils import clip_grad_norm_

from benchmarks.scene import built, composed, measured
from benchmarks.step import total
from benchmarks.table import Row, machine
from jointsdf.experiment import build
from jointsdf.optimizers import MuonAdam
from jointsdf.threads import large_pieces
from jointsdf.training.fit import fit
from jointsdf.training.hardware import freed_memory_kept
from jointsdf.training.module import JointSDFModule, merged_needs
from jointsdf.values import Samples

ROOT = Path(__file__).parents[1]
BUSY = 1.3  # times one thread's seconds under the same load
TARGETS = {"float32": (1.20, 45.0, 20.0), "bfloat16": (1.08, 25.0, 15.0)}  # orthogonalisation, fit, smoke
FIRST_LINE = 2.0


def rows(steps: int = 400, repetitions: int = 3, overrides: Sequence[str] = ()) -> list[Row]:
    """Seconds and ratios.

    Args:
        steps: Of the whole fit; a tenth of them for the comparison on a busy machine.
        repetitions: The medians are over so many.
        overrides: Of the config, to make the fits smaller; then nothing is claimed.
    """
    cfg = composed(*overrides)
    _, _, module = built(cfg)
    kind = measured(cfg, module).orthogonalisation
    share, seconds, smoke = TARGETS[kind]
    threads = torch.get_num_threads()
    with_it, without = orthogonalisation(steps // 4, overrides)
    quiet = statistics.median(fit_seconds(steps, overrides) for _ in range(repetitions))
    one, many = beside_a_busy_process(max(steps // 10, 2), repetitions, threads, overrides)
    first, whole = smoke_seconds()
    found = [
        Row("step of fast", f"orthogonalisation left out ({kind})", with_it, without, "s", with_it / without, share),
        Row("fit of fast, part_01", "allowed seconds", quiet, seconds, "s", quiet / seconds, 1.0),
        Row(f"fit, {threads} threads, busy machine", "one thread, same load", many, one, "s", many / one, BUSY),
        Row("smoke, whole run", "allowed seconds", whole, smoke, "s", whole / smoke, 1.0),
        Row("smoke, first line", "allowed seconds", first, FIRST_LINE, "s", first / FIRST_LINE, 1.0),
    ]
    return [replace(row, at_least=False, target=None if overrides else row.target) for row in found]


@freed_memory_kept()
def orthogonalisation(steps: int, overrides: Sequence[str]) -> tuple[float, float]:
    """Median seconds of a step, with Muon's iteration and without, taken in turn."""
    cfg = composed("data.pool_size=20000", *overrides)
    with machine(torch.get_num_threads(), "default"), large_pieces():
        sides = []
        for left_out in (False, True):
            _, data, module = built(cfg)
            module.products = measured(cfg, module)
            optimizer = module.configure_optimizers()["optimizer"]
            assert isinstance(optimizer, MuonAdam)
            if left_out:
                optimizer.muon.polynomials = ()
            sides.append((module.train(), optimizer, [data.sampler.draw(step) for step in range(steps)]))
        taken: list[list[float]] = [[], []]
        for step in range(steps):
            for (module, optimizer, samples), seconds in zip(sides, taken, strict=True):
                start = time.perf_counter()
                one_step(module, optimizer, samples[step], step)
                seconds.append(time.perf_counter() - start)
    with_it, without = (statistics.median(seconds[min(5, steps - 1) :]) for seconds in taken)
    return with_it, without


def one_step(module: JointSDFModule, optimizer: torch.optim.Optimizer, samples: Samples, step: int) -> None:
    """Objective, backward, clip and optimizer."""
    weights = module.objective.active_weights(step / module.settings.max_steps)
    terms = {name: module.objective.terms[name] for name in weights}
    optimizer.zero_grad()
    total(module.evaluate(samples, merged_needs(terms)), terms, weights).backward()
    for part in (module.field.trunk, module.field.head):
        clip_grad_norm_(part.parameters(), module.settings.clip)
    optimizer.step()


@large_pieces()
@freed_memory_kept()
def fit_seconds(steps: int, overrides: Sequence[str]) -> float:
    """A fit as a run does it, without previews."""
    cfg = composed(f"trainer.max_steps={steps}", *overrides)
    shape, data, module = built(cfg)
    given = build.labelled(cfg, shape, data.sampler.cloud)
    with tempfile.TemporaryDirectory() as folder:
        return fit(module, data, Path(folder), build.fit_machine(cfg), labelled=given)[0]


def beside_a_busy_process(steps: int, repetitions: int, threads: int, overrides: Sequence[str]) -> tuple[float, float]:
    """Median seconds of a short fit with one thread and with all, in turn, while another process takes a core."""
    taken: dict[int, list[float]] = {1: [], threads: []}
    with busy_process():
        for _ in range(repetitions):
            for number, seconds in taken.items():
                with machine(number, "default"):
                    seconds.append(fit_seconds(steps, overrides))
    return statistics.median(taken[1]), statistics.median(taken[threads])


@contextmanager
def busy_process() -> Iterator[None]:
    """Another process that computes without end, until the block does."""
    with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as process:
        try:
            yield
        finally:
            process.kill()


def smoke_seconds() -> tuple[float, float]:
    """Seconds of `train.py recipe=smoke` till its first line and till its end."""
    with tempfile.TemporaryDirectory() as outputs:
        command = [sys.executable, ROOT / "train.py", "recipe=smoke", f"paths.outputs={outputs}"]
        start = time.perf_counter()
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as process:
            assert process.stdout is not None
            process.stdout.readline()
            first = time.perf_counter() - start
            process.stdout.read()
        assert process.returncode == 0
        return first, time.perf_counter() - start
