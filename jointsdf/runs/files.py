"""Atomic, durable file writes: a temporary file, flushed to the disk, renamed over the old one, its folder flushed."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def replacing(path: Path, *, durable: bool = True) -> Iterator[Path]:
    """Yield a temporary path in the folder of `path`; when the block succeeds, fsync, rename it to `path`, fsync again.

    The second fsync is of the folder: without it the new name may be lost. Readers see the old file or the new one,
    also after a power cut, and what returned survives it. If the block fails, the old file is untouched.

    Args:
        path: The file to write; its folder is created where missing.
        durable: Whether to fsync, which takes milliseconds; not for what the next command makes anew anyway.

    Raises:
        OSError: The folder cannot be written or the disk is full.
    """
    make_folder(path.parent)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    temporary.unlink(missing_ok=True)  # a link of that name would be followed
    try:
        yield temporary
        if durable:
            with temporary.open("rb+") as file:
                os.fsync(file.fileno())
        os.replace(temporary, path)
        if durable:
            _sync_folder(path.parent)
    finally:
        temporary.unlink(missing_ok=True)


def make_folder(folder: Path) -> None:
    """Create a folder and those above it, durably."""
    if not folder.is_dir():
        make_folder(folder.parent)
        folder.mkdir(exist_ok=True)
        _sync_folder(folder.parent)


def sweep_temporaries(folder: Path) -> None:
    """Remove what killed processes left of `replacing`; call it where no other process writes to the folder."""
    for temporary in folder.glob(".*.tmp"):
        temporary.unlink(missing_ok=True)


def _sync_folder(folder: Path) -> None:
    """Flush a folder's names to the disk, where the system has that: POSIX, and not every network file system."""
    if os.name == "nt":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):
            raise
    finally:
        os.close(descriptor)


def write_atomically(path: Path, content: str | bytes, *, durable: bool = True) -> None:
    """Replace the content of a file by `replacing`; text is written as UTF-8 with line feeds.

    Args:
        path: The file; its folder is created where missing.
        content: Text or bytes. Surrogates, which UTF-8 lacks, are written as backslash escapes.
        durable: As for `replacing`.

    Raises:
        OSError: The folder cannot be written or the disk is full.
    """
    data = content.encode("utf-8", errors="backslashreplace") if isinstance(content, str) else content
    with replacing(path, durable=durable) as temporary:
        temporary.write_bytes(data)
