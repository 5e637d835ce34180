"""Advisory lock of a run folder (flock), released by the system when its process dies. Imports no torch.

Between hosts it holds where the file system carries flock to its server: NFS since Linux 2.6.12, which sends it as a
byte-range lock (flock(2)), CephFS, GPFS, and Lustre mounted with `flock`. Mounted with `nolock`, `local_lock=flock` or
`localflock` it holds between the processes of one host alone, which no process can see.
"""

import errno
import fcntl
import logging
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from jointsdf.errors import InputError
from jointsdf.runs.files import make_folder

LOCK = ".lock"
OPENED = os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC  # neither what a link names, nor a wait for a pipe's other end
NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)  # of a file system without them

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
        InputError: Its place is taken by a link, folder or pipe, or the file system has no locks.
    """
    path = folder / LOCK
    while True:
        make_folder(folder)
        descriptor = _open(path)
        try:
            _acquire(descriptor, folder, wait)
            if _is_at(path, descriptor):  # else its holder removed it in the meantime
                try:
                    yield
                finally:
                    path.unlink(missing_ok=True)
                return
        finally:
            os.close(descriptor)


def _open(path: Path) -> int:
    """Open or make the file; what it holds is left as it is, since it may be a link to a file of the user."""
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | OPENED, 0o666)
    except OSError as error:
        if error.errno in (errno.ELOOP, errno.EISDIR, errno.ENXIO):
            raise _no_file(path) from error
        raise
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise _no_file(path)
    return descriptor


def _no_file(path: Path) -> InputError:
    return InputError(f"{path}: a link, folder or pipe in place of the lock; remove it")


def _acquire(descriptor: int, folder: Path, wait: bool) -> None:
    """Lock the open file, or raise `Busy` where another process holds it and `wait` is false."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        if not wait:
            raise Busy(folder) from None
        log.info("%s: another process works on it; waiting for that one", folder)
        fcntl.flock(descriptor, fcntl.LOCK_EX)
    except OSError as error:
        if error.errno in NO_LOCKS:
            fix = "give paths.outputs=<a folder on another file system>, or mount this one with locks"
            raise InputError(f"{folder}: its file system has no locks (flock: {error.strerror}); {fix}") from error
        raise


def _is_at(path: Path, descriptor: int) -> bool:
    """True if the open file is the one at the path."""
    try:
        return os.path.samestat(path.lstat(), os.fstat(descriptor))
    except FileNotFoundError:
        return False


def is_locked(folder: Path) -> bool:
    """True if a process holds the lock of a run folder; false where that cannot be found out."""
    try:
        descriptor = os.open(folder / LOCK, os.O_RDONLY | OPENED)
    except OSError:
        return False
    try:
        if stat.S_ISREG(os.fstat(descriptor).st_mode):
            fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    finally:
        os.close(descriptor)
    return False
