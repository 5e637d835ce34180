"""Progress of a run: each phase is named as it begins, with a bar on a terminal and a line every half minute elsewhere.

Code within a phase may `tell` how far it is; the work does not depend on it. Imports no torch.
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

TICK_SECONDS = 30.0  # between two lines of a long phase, where there is no terminal

log = logging.getLogger(__name__)  # a line a phase
ticks = logging.getLogger(f"{__name__}.ticks")  # and those of a long one; a sweep silences the former alone
ticks.setLevel(logging.INFO)
console = Console(stderr=True)  # the one that bars and log lines share, so that neither runs through the other


@dataclass
class Phase:
    """A phase under way.

    Attributes:
        name: One word.
        done: How much of `total` is done.
        total: 0 where that is not known.
        facts: What else there is to say.
        began: Monotonic seconds.
        bar: On a terminal.
    """

    name: str
    done: int = 0
    total: int = 0
    facts: str = ""
    began: float = field(default_factory=time.monotonic)
    bar: Progress | None = None

    def line(self) -> str:
        """How it stands, in words."""
        share = f"{self.done} of {self.total}" if self.total else ""
        said = [share, self.facts, f"{time.monotonic() - self.began:.0f} s so far"]
        return f"{_title(self.name)}: {', '.join(part for part in said if part)}"

    def show(self) -> None:
        """Move the bar."""
        if self.bar is not None:
            (task,) = self.bar.task_ids
            self.bar.update(task, completed=self.done, total=self.total or None, facts=self.facts)


@dataclass
class _State:
    run: str = ""  # names the run, where there are several
    silent: bool = False
    now: Phase | None = None


_state = _State()


@contextmanager
def run_named(name: str) -> Iterator[None]:
    """Within the block, phases belong to this run of several, e.g. `siren part_01`."""
    before, _state.run = _state.run, name
    try:
        yield
    finally:
        _state.run = before


@contextmanager
def no_progress() -> Iterator[None]:
    """Within the block phases show neither a bar nor a line of progress."""
    before, _state.silent = _state.silent, True
    try:
        yield
    finally:
        _state.silent = before


@contextmanager
def phase(name: str, what: str = "") -> Iterator[None]:
    """Name what begins, and show how far it is until the block ends.

    Args:
        name: One word.
        what: What it works on; for the line that says that it begins.
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
    """Say how far the phase under way is; what is None stays as it was. Without a phase nothing happens."""
    if (now := _state.now) is None:
        return
    now.done, now.total = now.done if done is None else done, now.total if total is None else total
    now.facts = now.facts if facts is None else facts
    now.show()


class _Count(ProgressColumn):
    """`12/400`, where the total is known."""

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
