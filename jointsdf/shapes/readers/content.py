"""Content of a mesh or STEP file, decompressed, whose format is that of its name."""

import hashlib
import zlib
from pathlib import Path
from typing import NamedTuple

from jointsdf.errors import InputError
from jointsdf.shapes.readers.formats import (
    CONTAINERS,
    GZIP,
    LISTED,
    READ,
    SOME,
    UNREAD,
    format_of,
    stem_of,
    suffix_of,
    unread_by_name,
)
from jointsdf.shapes.readers.recognition import recognise

LARGEST = 1 << 32  # bytes of a decompressed file
SMALL, RATIO = 1 << 26, 200  # bytes, and compression beyond which a larger file is no mesh but a "bomb"
PIECE = 1 << 12  # bytes decompressed at a time, into a thousand times as many at most
GZIP_MEMBER = 31  # zlib's window, with gzip's header


class Content(NamedTuple):
    """Content of a file that can be a shape.

    Attributes:
        format: One of the values of `formats.READ`.
        data: Bytes, decompressed.
        sha256: Of the bytes on the disk.
    """

    format: str
    data: bytes
    sha256: str


def read_content(path: Path) -> Content:
    """Read a file, after checking that it is a non-empty file of a format that is read, by its name and its content.

    Raises:
        InputError: The file is missing, a folder, a pipe, empty or unreadable, is or holds another format than its name
            says, or is compressed and truncated, damaged, or too large.
    """
    data, sha256 = read_file(path)
    _check_format(path, data)
    if is_blank(data):
        raise InputError(f"{path} is empty ({path.stat().st_size} bytes without a mesh): export it again")
    return Content(format_of(path), data, sha256)


def read_file(path: Path) -> tuple[bytes, str]:
    """Read a file of any format: its bytes, decompressed, and the hash of those on the disk.

    Raises:
        InputError: The file is missing, a folder, a pipe, or unreadable, or its compression is damaged.
    """
    require_file(path)
    try:
        stored = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path} cannot be opened: {error.strerror}") from error
    return unpack(path, stored), hashlib.sha256(stored).hexdigest()


def require_file(path: Path) -> None:
    """Refuse what is no regular file.

    Raises:
        InputError: It is missing, a folder, a pipe or a device.
    """
    if not path.exists():
        raise InputError(f"file not found: {path}")
    if path.is_dir():
        raise InputError(f"{path} is a folder: give the mesh file in it")
    if not path.is_file():
        raise InputError(f"{path} is a pipe or device, which may never end: give a file")


def is_blank(data: bytes) -> bool:
    """True for nothing but space and zeros."""
    return not data.strip(b" \t\r\n\0")


def _check_format(path: Path, data: bytes) -> None:
    """Refuse a file that is not read, or whose content is of another format than its name says."""
    said, held = format_of(path), recognise(data)
    if (said, held) == ("obj", "utf16"):  # whose reader decodes it
        return
    if held in READ.values() and held != said:
        what = f"not {said.upper()} as its name says" if said else "which its name does not say"
        raise InputError(f"{path} holds {held.upper()}, {what}: rename it to {_renamed(path, held)}")
    named = unread_by_name(path)
    unread = named if named and held in ("", *CONTAINERS) else UNREAD.get(held)
    if unread:
        raise InputError(f"{path} is {unread.name}: {unread.fix}")
    if not said:
        suffix = suffix_of(path)
        raise InputError(
            f"{path}: format {suffix or 'without suffix'} is not read; use one of {LISTED}; for points {SOME}"
        )


def _renamed(path: Path, suffix: str) -> str:
    """The file's name with another suffix; that of a compression stays."""
    packing = path.suffix if path.suffix.lower() == GZIP else ""
    return f"{stem_of(path)}.{suffix}{packing}"


def unpack(path: Path, stored: bytes) -> bytes:
    """Decompress a file whose name ends in `.gz` (gzip, RFC 1952); any other one is as it is.

    It is decompressed in pieces, so that a small file cannot fill the memory.

    Args:
        path: The file.
        stored: Its bytes: one or several members, one after another.

    Raises:
        InputError: It is no gzip, truncated, damaged, or larger than a mesh.
    """
    if not stored or path.suffix.lower() != GZIP:
        return stored
    pieces: list[bytes] = []
    size, at = 0, 0
    while stored[at:].strip(b"\0"):
        member = zlib.decompressobj(GZIP_MEMBER)
        while not member.eof:
            piece = stored[at : at + PIECE]
            if not piece:
                raise InputError(f"{path} is truncated: its gzip stream ends early; copy or compress it again")
            try:
                pieces.append(member.decompress(piece))
            except zlib.error as error:
                raise InputError(f"{path} is no gzip file, or damaged ({error}): compress it again") from error
            at += len(piece) - len(member.unused_data)
            size += len(pieces[-1])
            if size > LARGEST or (size > SMALL and size > RATIO * at):
                raise InputError(f"{path} grows beyond {size >> 20} MiB from {at} bytes: no mesh; give it decompressed")
    return b"".join(pieces)
