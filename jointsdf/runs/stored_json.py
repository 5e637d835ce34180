"""JSON of run folders and studies, damaged or from strangers: strict, read in bounds. Imports no torch."""

import json
import math
import os
import stat
from pathlib import Path
from typing import Any, NoReturn

from jointsdf.errors import shown

MOST_BYTES = 1 << 20  # a row with the IoU of 5,000 parts by two protocols has half of it
MOST_WHOLE = 1 << 53  # integers up to here are exact in float64
MOST_CHARACTERS = 10_000  # of a text


def read_regular(path: Path, most: int = MOST_BYTES) -> bytes:
    """Content of a regular file; a pipe, device or folder in its place is neither waited for nor read.

    Args:
        path: The file, or a link to it.
        most: Largest size, bytes.

    Raises:
        OSError: It is not there, or cannot be opened.
        ValueError: It is no regular file, or larger.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    with open(descriptor, "rb") as file:
        about = os.fstat(descriptor)
        if not stat.S_ISREG(about.st_mode):
            raise ValueError("it is no regular file")
        data = file.read(most + 1) if about.st_size <= most else b""
    if about.st_size > most or len(data) > most:
        raise ValueError(f"it is larger than {most >> 20} MiB")
    return data


def read_json(path: Path, most: int = MOST_BYTES) -> Any:
    """Parse a file of strict JSON (RFC 8259), without repeated keys and constants such as NaN.

    Numbers may be infinite, and integers of any size: `whole` and `number` refuse them.

    Args:
        path: The file, UTF-8.
        most: Largest size, bytes.

    Raises:
        FileNotFoundError: There is none.
        ValueError: It cannot be read, or holds something else. One line, without the path.
    """
    try:
        return json.loads(
            read_regular(path, most).decode("utf-8"),
            parse_constant=_refuse_constant,
            object_pairs_hook=_refuse_repeated,
        )
    except FileNotFoundError:
        raise
    except OSError as error:
        raise ValueError(f"it cannot be opened ({error.strerror})") from error
    except RecursionError as error:
        raise ValueError("nested too deeply") from error


def whole(value: Any) -> int:
    """The value, an integer from 0 to `MOST_WHOLE`.

    Raises:
        ValueError: It is something else.

    >>> whole(True)
    Traceback (most recent call last):
    ValueError: True is no integer from 0 to 9007199254740992
    """
    if type(value) is not int or not 0 <= value <= MOST_WHOLE:
        raise ValueError(f"{_brief(value)} is no integer from 0 to {MOST_WHOLE}")
    return value


def number(value: Any, low: int | float, high: int | float) -> float:
    """The value, a number within the limits; NaN for None.

    Raises:
        ValueError: It is something else.

    >>> number(1, 0, 2), number(None, 0, 2)
    (1.0, nan)
    """
    if type(value) is float and low <= value <= high:
        return value
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return math.nan
    if not isinstance(value, int | float) or isinstance(value, bool) or not low <= value <= high:
        raise ValueError(f"{_brief(value)} is no number from {low:g} to {high:g}")
    return float(value)


def _refuse_constant(token: str) -> NoReturn:
    raise ValueError(f"{token} is not JSON")


def _refuse_repeated(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) < len(pairs):
        raise ValueError("a key is there twice")
    return content


def _brief(value: Any) -> str:
    """The value as part of a line; of what is no plain value, its type."""
    plain = isinstance(value, str | float | bool | None) or (isinstance(value, int) and abs(value) < 1 << 63)
    if not plain:
        return f"what is of type {type(value).__name__}"
    return shown(repr(value) if isinstance(value, str) else value)
