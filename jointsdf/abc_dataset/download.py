"""Download of one archive from ABC's server: resumed after a break, and accepted only with the right md5."""

import errno
import hashlib
import http.client
import logging
import re
import shutil
import ssl
import time
import urllib.error
import urllib.request
from pathlib import Path

from jointsdf.abc_dataset.chunks import Chunk
from jointsdf.abc_dataset.progress import Progress, silent
from jointsdf.errors import InputError

BLOCK = 1 << 20  # bytes read at once
FULL = (errno.ENOSPC, errno.EDQUOT)
BUSY = (408, 425, 429, 500, 502, 503, 504)  # HTTP answers that another try may change
BROKEN = (ConnectionError, TimeoutError, ssl.SSLError, urllib.error.URLError, http.client.HTTPException)

logger = logging.getLogger(__name__)


def part_path(chunk: Chunk, folder: Path) -> Path:
    """File of the bytes received so far."""
    return folder / f"{chunk.name}.part"


def bytes_here(chunk: Chunk, folder: Path) -> int:
    """Number of bytes of the archive that need no download."""
    if (folder / chunk.name).is_file():
        return chunk.bytes
    part = part_path(chunk, folder)
    return part.stat().st_size if part.is_file() else 0


def fetch(
    chunk: Chunk,
    folder: Path,
    progress: Progress = silent,
    *,
    tries: int = 3,
    pause: float = 2.0,
    timeout: float = 60.0,
) -> Path:
    """Download an archive, unless it exists.

    Args:
        chunk: The archive.
        folder: Gets the archive; an incomplete one stays there as `.part`, whatever happens.
        progress: Shows how much has been received.
        tries: Connections before giving up.
        pause: Seconds before the second try, twice as many before the third, and so on.
        timeout: Seconds without a byte that end a try.

    Returns:
        The archive.

    Raises:
        InputError: The address does not give the file, the connection keeps breaking, the disk is full, or the md5
            is not the one of ABC's list (the download is then deleted).
    """
    target, part = folder / chunk.name, part_path(chunk, folder)
    if target.is_file():
        return target
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _check_space(chunk, folder)
        _download(chunk, part, progress, tries, pause, timeout)
        _check_md5(chunk, part, progress)
        part.replace(target)
    except OSError as error:
        if error.errno not in FULL:
            raise
        raise InputError(
            f"{part}: the disk is full; free {(chunk.bytes - bytes_here(chunk, folder)) / 1e9:.1f} GB or give another "
            f"--root, and run it again: it goes on from here"
        ) from error
    return target


def _check_space(chunk: Chunk, folder: Path) -> None:
    """Refuse a download that does not fit on the disk."""
    missing, free = chunk.bytes - bytes_here(chunk, folder), shutil.disk_usage(folder).free
    if missing > free:
        raise InputError(
            f"{folder}: {chunk.name} needs {missing / 1e9:.1f} GB more and {free / 1e9:.1f} GB are free: free some "
            f"space, or give another --root"
        )


def _download(chunk: Chunk, part: Path, progress: Progress, tries: int, pause: float, timeout: float) -> None:
    """Connect until all bytes are received, `tries` times at most."""
    for attempt in range(1, tries + 1):
        try:
            return _append_missing(chunk, part, progress, timeout)
        except BROKEN as error:
            if isinstance(error, urllib.error.HTTPError):
                error.close()
            if isinstance(error, urllib.error.HTTPError) and error.code not in BUSY:
                raise InputError(
                    f"{chunk.url} answers {error.code} {error.reason}: give another address of {chunk.name} with "
                    f"--urls, or get it by other means and use --from"
                ) from error
            received = part.stat().st_size if part.exists() else 0
            why = " ".join(str(getattr(error, "reason", "") or error or type(error).__name__).split())
            state = f"{chunk.url}: {why}; {received} of {chunk.bytes} bytes are here"
            if attempt == tries:
                raise InputError(f"{state} after {tries} tries: run it again, it goes on from there") from error
            logger.warning("%s; trying again in %g s", state, pause * attempt)
            time.sleep(pause * attempt)


def _append_missing(chunk: Chunk, part: Path, progress: Progress, timeout: float) -> None:
    """Append the missing bytes, as far as one connection lasts."""
    have = part.stat().st_size if part.exists() else 0
    if have >= chunk.bytes:  # more cannot be right: the md5 check finds out
        return
    headers = {"User-Agent": "jointsdf", **({"Range": f"bytes={have}-"} if have else {})}
    request = urllib.request.Request(chunk.url, headers=headers)
    with urllib.request.urlopen(request, timeout=timeout) as answer:
        start, total = _parse_extent(answer)
        if total not in (None, chunk.bytes) or start > have:
            raise InputError(
                f"{chunk.url} sends a file of {total} bytes, {chunk.name} has {chunk.bytes}: it is not ABC's archive; "
                f"give another address with --urls"
            )
        with part.open("r+b" if have else "wb") as file, progress(f"download {chunk.name}", chunk.bytes) as show:
            file.truncate(start)
            file.seek(start)
            while (block := answer.read1(BLOCK)) and file.tell() < chunk.bytes:
                file.write(block)
                show(file.tell())
            received = file.tell()
    if received < chunk.bytes:
        raise ConnectionError("the connection was closed half-way")


def _parse_extent(answer: http.client.HTTPResponse) -> tuple[int, int | None]:
    """First byte of the file that an answer holds, and the file's size (None where the server does not give it)."""
    if answer.status == 206:
        extent = re.fullmatch(r"bytes (\d+)-\d+/(\d+|\*)", answer.headers.get("Content-Range", ""))
        if not extent:
            raise ConnectionError("the server's answer does not say which part of the file it is")
        return int(extent[1]), None if extent[2] == "*" else int(extent[2])
    length = answer.headers.get("Content-Length", "")
    return 0, int(length) if length.isdecimal() else None


def _check_md5(chunk: Chunk, part: Path, progress: Progress) -> None:
    """Delete the download unless it has the md5 of ABC's list."""
    digest = hashlib.md5(usedforsecurity=False)
    with part.open("rb") as file, progress(f"check {chunk.name}", chunk.bytes) as show:
        while block := file.read(BLOCK):
            digest.update(block)
            show(file.tell())
    if digest.hexdigest() != chunk.md5:
        part.unlink()
        raise InputError(
            f"{chunk.name} from {chunk.url} has md5 {digest.hexdigest()}, ABC's list says {chunk.md5}: the download is "
            f"deleted; run it again, or give another address with --urls"
        )
