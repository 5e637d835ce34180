"""Advisory lock of a run folder (flock), released by the system when its process dies. Imports no torch."""

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
    """Another process holds the lock of the run folder."""


@contextmanager
def lock(folder: Path, *, wait: bool) -> Iterator[None]:
    """Hold the run folder's lock during the block; it ends with the block or with the process.

    Args:
        folder: Created where missing.
        wait: Whether to wait for another process to finish its work there.

    Raises:
        Busy: Another process holds it, and `wait` is false.
    """
    path = folder / LOCK
    while True:
        folder.mkdir(parents=True, exist_ok=True)
        with path.open("w") as file:
            _acquire(file, folder, wait)
            if _is_at(path, file):  # else its holder removed it in the meantime
                try:
                    yield
                finally:
                    path.unlink(missing_ok=True)
                return


def _acquire(file: IO[str], folder: Path, wait: bool) -> None:
    """Lock the open file, or raise `Busy` where another process holds it and `wait` is false."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        if not wait:
            raise Busy(folder) from None
        log.info("%s: another process works on it; waiting for that one", folder)
        fcntl.flock(file, fcntl.LOCK_EX)


def _is_at(path: Path, file: IO[str]) -> bool:
    """True if the open file is the one at the path."""
    try:
        return os.path.samestat(path.stat(), os.fstat(file.fileno()))
    except FileNotFoundError:
        return False


def is_locked(folder: Path) -> bool:
    """True if a process holds the lock of a run folder."""
    try:
        with (folder / LOCK).open() as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except FileNotFoundError:
        return False
    except BlockingIOError:
        return True
    return False
