"""Progress of a run by phases: a line at the start of each, then a bar on a terminal or a line every half minute.

Code within a phase may `tell` its progress; results do not depend on it. Imports no torch.
"""

import logging
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.text import Text

TICK_SECONDS = 30.0  # between two lines of a phase without a terminal

log = logging.getLogger(__name__)  # starts of phases
ticks = logging.getLogger(f"{__name__}.ticks")  # progress of long ones, which a sweep shows as well
ticks.setLevel(logging.INFO)
console = Console(stderr=True)  # shared by bars and log lines, so that neither overwrites the other


@dataclass
class Phase:
    """A phase in progress.

    Attributes:
        name: One word.
        done: Units of work done.
        total: Units of work in all; 0 where that is not known.
        facts: Further facts for the line, e.g. a loss.
        began: Start, monotonic seconds.
        bar: Progress bar; None without a terminal.
    """

    name: str
    done: int = 0
    total: int = 0
    facts: str = ""
    began: float = field(default_factory=time.monotonic)
    bar: Progress | None = None

    def line(self) -> str:
        """Progress in one line.

        >>> Phase("fit", 12, 400, "loss 3.1").line()
        'fit: 12 of 400, loss 3.1, 0 s so far'
        """
        share = f"{self.done} of {self.total}" if self.total else ""
        parts = [share, self.facts, f"{time.monotonic() - self.began:.0f} s so far"]
        return f"{_title(self.name)}: {', '.join(part for part in parts if part)}"

    def show(self) -> None:
        """Update the bar."""
        if self.bar is not None:
            (task,) = self.bar.task_ids
            self.bar.update(task, completed=self.done, total=self.total or None, facts=self.facts)


@dataclass
class _State:
    run: str = ""  # name of the run in a sweep
    silent: bool = False
    now: Phase | None = None


_state = _State()


@contextmanager
def run_named(name: str) -> Iterator[None]:
    """Prefix phases within the block by the name of their run, e.g. `siren part_01`."""
    before, _state.run = _state.run, name
    try:
        yield
    finally:
        _state.run = before


@contextmanager
def no_progress() -> Iterator[None]:
    """Show neither bars nor lines of progress within the block."""
    before, _state.silent = _state.silent, True
    try:
        yield
    finally:
        _state.silent = before


@contextmanager
def phase(name: str, what: str = "") -> Iterator[None]:
    """Log the start of a phase, and show its progress until the block ends.

    Args:
        name: One word.
        what: Input of the phase, for the line at its start.
    """
    before, now = _state.now, Phase(name)
    log.info("%s%s", _title(name), f": {what}" if what else "")
    ended = threading.Event()
    _state.now = now
    try:
        if _state.silent:
            yield
        elif console.is_terminal:
            with _bar(now):
                yield
        else:
            threading.Thread(target=_tick, args=(now, ended), daemon=True).start()
            yield
    finally:
        _state.now = before
        ended.set()


def tell(done: int | None = None, total: int | None = None, facts: str | None = None) -> None:
    """Update the progress of the current phase, if there is one; None leaves a value unchanged.

    Args:
        done: Units of work done.
        total: Units of work in all.
        facts: Further facts for the line.
    """
    if (now := _state.now) is None:
        return
    now.done, now.total = now.done if done is None else done, now.total if total is None else total
    now.facts = now.facts if facts is None else facts
    now.show()


class _Count(ProgressColumn):
    """Column `12/400`, empty where the total is not known."""

    def render(self, task: Task) -> Text:
        return Text("" if task.total is None else f"{task.completed:.0f}/{task.total:.0f}", "progress.download")


@contextmanager
def _bar(now: Phase) -> Iterator[None]:
    columns = (BarColumn(bar_width=30), _Count(), TextColumn("{task.fields[facts]}"), TimeRemainingColumn())
    with Progress(TextColumn("{task.description}"), *columns, console=console, transient=True) as now.bar:
        now.bar.add_task(_title(now.name), total=None, facts="")
        yield


def _tick(now: Phase, ended: threading.Event) -> None:
    while not ended.wait(TICK_SECONDS):
        ticks.info(now.line())


def _title(name: str) -> str:
    return f"{_state.run}: {name}" if _state.run else name
