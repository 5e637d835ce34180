"""The lock of a run folder, which dies with its process (flock). Imports no torch."""

import fcntl
import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

LOCK = ".lock"

log = logging.getLogger(__name__)


class Busy(Exception):
    """Another process writes the run folder."""


@contextmanager
def lock(folder: Path, *, wait: bool) -> Iterator[None]:
    """Keep every other process out of the run folder; the lock dies with its process.

    Args:
        folder: Made where it is not there.
        wait: Whether to wait for another process to finish its work there.

    Raises:
        Busy: Another process holds it, and `wait` is false.
    """
    path = folder / LOCK
    while True:
        folder.mkdir(parents=True, exist_ok=True)
        with path.open("w") as file:
            _acquire(file, folder, wait)
            if _is(path, file):  # else its holder has removed it meanwhile
                try:
                    yield
                finally:
                    path.unlink(missing_ok=True)
                return


def _acquire(file: IO[str], folder: Path, wait: bool) -> None:
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        if not wait:
            raise Busy(folder) from None
        log.info("%s: another process works on it; waiting for that one", folder)
        fcntl.flock(file, fcntl.LOCK_EX)


def _is(path: Path, file: IO[str]) -> bool:
    try:
        return os.path.samestat(path.stat(), os.fstat(file.fileno()))
    except FileNotFoundError:
        return False


def is_locked(folder: Path) -> bool:
    """Whether a process holds the lock of a run folder."""
    try:
        with (folder / LOCK).open() as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except FileNotFoundError:
        return False
    except BlockingIOError:
        return True
    return False
