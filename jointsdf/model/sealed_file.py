"""Files of torch with a checksum (SHA-256, FIPS 180-4) of what they hold, which is compared when they are read.

A checksum finds damage; whoever changes a file on purpose can change its checksum as well.
"""

import hashlib
import io
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

CHECKSUM = "sha256"
BAD_ARCHIVE = (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, ValueError)  # of a damaged zip file


def save_sealed(content: Mapping[str, Any], path: str | Path) -> None:
    """Write plain values and tensors with their checksum, for `load_sealed`.

    The archive is made in memory: a failed write of torch's own says neither what failed nor why.

    Raises:
        OSError: The file cannot be written or the disk is full.
    """
    archive = io.BytesIO()
    torch.save({**content, CHECKSUM: checksum(content)}, archive)
    Path(path).write_bytes(archive.getbuffer())


def load_sealed(path: str | Path) -> dict[str, Any]:
    """Read plain values and tensors, on the CPU; nothing of the file is run.

    The checksums of the zip archive, which files from before have alone, are compared as well.

    Raises:
        ValueError: The file is damaged, or no file of torch.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            damaged = archive.testzip()
    except BAD_ARCHIVE as error:
        raise ValueError(f"no archive of torch, or cut short: {error}") from error
    if damaged is not None:
        raise ValueError(f"damaged: {damaged} within it does not match its checksum")
    stored = torch.load(path, map_location="cpu", weights_only=True)
    if not isinstance(stored, dict):
        raise ValueError("it holds no table of values")
    expected = stored.pop(CHECKSUM, None)
    if expected is not None and expected != checksum(stored):
        raise ValueError("damaged: its content does not match its checksum")
    content: dict[str, Any] = stored
    return content


def checksum(value: Any) -> str:
    """SHA-256 of nested tables, sequences, tensors and plain values, independent of how they are stored.

    >>> checksum({"a": [1, 2.0, None]})[:16]
    '10002cb5facff6a5'
    >>> checksum({"a": torch.zeros(2)}) == checksum({"a": torch.zeros(2, dtype=torch.float64)})
    False

    Raises:
        TypeError: A value of another type.
    """
    found = hashlib.sha256()
    _add(value, found)
    return found.hexdigest()


def _add(value: Any, found: Any) -> None:
    """Feed a value to the hash: its kind and size first, so that no two values give the same bytes."""
    if isinstance(value, Tensor):
        found.update(f"tensor {value.dtype} {tuple(value.shape)}\n".encode())
        if value.numel():
            found.update(value.detach().cpu().contiguous().reshape(-1).view(torch.uint8).numpy())
    elif isinstance(value, Mapping):
        found.update(f"table {len(value)}\n".encode())
        for key, held in value.items():
            _add(key, found)
            _add(held, found)
    elif isinstance(value, str | bytes):
        data = value.encode(errors="surrogatepass") if isinstance(value, str) else value
        found.update(f"{type(value).__name__} {len(data)}\n".encode() + data)
    elif isinstance(value, Sequence):
        found.update(f"sequence {len(value)}\n".encode())
        for held in value:
            _add(held, found)
    elif value is None or isinstance(value, bool | int | float):
        found.update(f"{type(value).__name__} {value!r}\n".encode())
    else:
        raise TypeError(f"{type(value).__name__}: neither a tensor nor a plain value")
