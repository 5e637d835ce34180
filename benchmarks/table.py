"""A measured ratio, how it is taken, and the table of them."""

import csv
import statistics
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from jointsdf.runs.provenance import code_state, provenance
from jointsdf.training import matrix_products as products
from jointsdf.training.hardware import KEPT_FREE, LARGEST_KEPT, freed_memory_kept
from jointsdf.training.product_choice import machine_kind

GLIBC_KEEPS = 2 * LARGEST_KEPT  # where its own rule ends up once pieces of the largest size have been freed


@dataclass(frozen=True)
class Row:
    """One comparison.

    Attributes:
        what: Our side.
        against: The other side.
        ours: Median of our side.
        theirs: Median of the other side.
        unit: Of both.
        ratio: The number that is claimed.
        target: What it should be; None where nothing is claimed.
        at_least: Whether the target is a lower bound, else an upper one.
    """

    what: str
    against: str
    ours: float
    theirs: float
    unit: str
    ratio: float
    target: float | None = None
    at_least: bool = True

    @property
    def met(self) -> bool | None:
        """True if the target is met; None without a target."""
        if self.target is None:
            return None
        return self.ratio >= self.target if self.at_least else self.ratio <= self.target

    def line(self) -> str:
        """The row as a line of the table."""
        bound = "" if self.target is None else f"{'>=' if self.at_least else '<='} {self.target:g}"
        verdict = {None: "", True: "met", False: "missed"}[self.met]
        sides = f"{self.ours:10.4g} {self.theirs:10.4g} {self.unit:8s}"
        return f"{self.what:44s} {self.against:58s} {sides} {self.ratio:8.3g} {bound:8s} {verdict}"


HEADER = f"{'what':44s} {'compared with':58s} {'ours':>10s} {'theirs':>10s} {'unit':8s} {'ratio':>8s} {'target':8s}"


def table(rows: Sequence[Row]) -> list[str]:
    """Every row, and one line of summary last."""
    claimed = [row for row in rows if row.target is not None]
    missed = [row.what for row in claimed if not row.met]
    summary = f"{len(claimed) - len(missed)} of {len(claimed)} targets met"
    return [HEADER, *(row.line() for row in rows), summary + (f"; missed: {', '.join(missed)}" if missed else "")]


def append(path: Path, rows: Sequence[Mapping[str, Any]], command: str) -> None:
    """Append rows to a CSV file with what made them: command, commit, machine, date and the machine's kind."""
    known = provenance(code_state(), config_hash="")
    made = {"command": command, **{key: known[key] for key in ("commit", "dirty", "machine", "date")}}
    made["kind"] = machine_kind()
    new = not path.exists()
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [*rows[0], *made])
        if new:
            writer.writeheader()
        writer.writerows({**row, **made} for row in rows)


def interleaved(
    repetitions: int,
    *sides: Callable[[], object],
    warm_up: bool = True,
    clock: Callable[[], float] = time.perf_counter,
) -> list[float]:
    """Median seconds of each side, taken in turn so that a busy machine hurts them alike.

    Args:
        repetitions: The medians are over so many.
        sides: What is timed.
        warm_up: Whether each side runs once before it is timed.
        clock: In seconds; `time.process_time` for those of all cores together, which other processes take no part in.
    """
    taken: list[list[float]] = [[] for _ in sides]
    for repetition in range(0 if warm_up else 1, repetitions + 1):
        for side, seconds in zip(sides, taken, strict=True):
            start = clock()
            side()
            if repetition:
                seconds.append(clock() - start)
    return [statistics.median(seconds) for seconds in taken]


@contextmanager
def machine(threads: int, matmul: str, *, keep_memory: bool = True) -> Iterator[None]:
    """Threads, the path of float32 matrix products (`default` or `onednn`), and freed memory, as in a run.

    Args:
        threads: Of each operation.
        matmul: As in `products.CHOICES`.
        keep_memory: Whether freed memory waits for the next step, as in our runs, or goes back by glibc's own rule.
    """
    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    try:
        with products.matmul(matmul), freed_memory_kept(KEPT_FREE if keep_memory else GLIBC_KEEPS):
            yield
    finally:
        torch.set_num_threads(before)
