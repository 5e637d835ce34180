"""Rows and numbers of text files."""

import logging
import re
from collections.abc import Iterable, Sequence

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.errors import InputError

PADDING = b"\0 \t\x1a"  # that some programs append to the last line

logger = logging.getLogger(__name__)


def split_rows(text: bytes, comment: bytes = b"") -> list[list[bytes]]:
    """Split a text into the words of its lines, without empty lines and padding.

    Args:
        text: Lines that end in LF, CR LF or CR.
        comment: What begins a comment, if anything.
    """
    lines = re.split(rb"[\r\n]+", text.rstrip(PADDING))
    if comment:
        lines = [line.partition(comment)[0] for line in lines]
    return [words for line in lines if (words := line.split())]


def warn_unless_ended(source: str, text: bytes) -> None:
    """Warn of a whole text whose last line has no line break: where it was cut in its last number, nothing else shows.

    Args:
        source: Names the file in messages.
        text: The file's content.
    """
    if not text.rstrip(PADDING).endswith((b"\n", b"\r")):
        logger.warning("%s: no line break follows its last number: if the file was cut, it may lack digits", source)


def parse_floats(source: str, words: Sequence[bytes]) -> Float[ndarray, " n"]:
    """Parse decimal numbers, `nan` and `inf` among them.

    Args:
        source: Names the file in messages.
        words: One number each.

    Raises:
        InputError: A word is no number.
    """
    try:
        return np.fromiter(map(float, words), dtype=np.float64, count=len(words))
    except ValueError:
        raise _no_number(source, words, float) from None


def parse_integers(source: str, words: Sequence[bytes]) -> Int[ndarray, " n"]:
    """Parse whole numbers, which may be written as decimal numbers, e.g. `3.0`.

    Args:
        source: Names the file in messages.
        words: One number each.

    Raises:
        InputError: A word is no whole number of 64 bits.
    """
    try:
        return np.fromiter(map(int, words), dtype=np.int64, count=len(words))
    except (ValueError, OverflowError):
        pass
    values = parse_floats(source, words)
    if not (np.abs(values) < 2**53).all() or (values != np.rint(values)).any():
        raise _no_number(source, words, lambda word: _require_whole(float(word)))
    return values.astype(np.int64)


def _require_whole(value: float) -> None:
    if not abs(value) < 2**53 or value != int(value):
        raise ValueError


def _no_number(source: str, words: Iterable[bytes], parse: object) -> InputError:
    """The error that names the first word that cannot be parsed."""
    for word in words:
        try:
            parse(word)  # type: ignore[operator]
        except ValueError:
            shown = word[:40].decode("ascii", errors="replace")
            kind = "number" if parse is float else "whole number"
            return InputError(f"{source} has {shown!r} where a {kind} is needed (a point, as in 1.5): export it again")
    raise AssertionError("every word is a number")
