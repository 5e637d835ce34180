"""Atomic, durable file writes: a temporary file, flushed to the disk, then renamed over the old one."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path in the folder of `path`; when the block succeeds, fsync its file and rename it to `path`.

    Readers see the old file or the new one, also after a power cut. If the block fails, the old file is untouched.

    Args:
        path: The file to write; its folder is created where missing.

    Raises:
        OSError: The folder cannot be written or the disk is full.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        yield temporary
        with temporary.open("rb+") as file:
            os.fsync(file.fileno())
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def write_atomically(path: Path, content: str | bytes) -> None:
    """Replace the content of a file by `replacing`; text is written as UTF-8 with line feeds.

    Args:
        path: The file; its folder is created where missing.
        content: Text or bytes. Surrogates, which UTF-8 lacks, are written as backslash escapes.

    Raises:
        OSError: The folder cannot be written or the disk is full.
    """
    data = content.encode("utf-8", errors="backslashreplace") if isinstance(content, str) else content
    with replacing(path) as temporary:
        temporary.write_bytes(data)
