"""Progress of long steps: bars on a terminal, nothing elsewhere."""

import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

from rich import progress
from rich.console import Console

Progress = Callable[[str, int], AbstractContextManager[Callable[[int], None]]]


@contextmanager
def silent(title: str, total: int) -> Iterator[Callable[[int], None]]:  # noqa: ARG001
    """Show nothing."""
    yield lambda done: None  # noqa: ARG005


@contextmanager
def bars(title: str, total: int) -> Iterator[Callable[[int], None]]:
    """Show a bar on standard error while the block runs, nothing where that is no terminal.

    Args:
        title: Of the step.
        total: Bytes in all.
    """
    columns = (
        progress.TextColumn("{task.description}"),
        progress.BarColumn(),
        progress.DownloadColumn(),
        progress.TransferSpeedColumn(),
        progress.TimeRemainingColumn(),
    )
    shown = sys.stderr.isatty()
    with progress.Progress(*columns, console=Console(stderr=True), transient=True, disable=not shown) as display:
        task = display.add_task(title, total=total)
        yield lambda done: display.update(task, completed=done)
