"""Facets of a text STL file."""

import logging
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.errors import InputError

BEGIN = re.compile(rb"\s*solid\b[^\r\n]*", re.IGNORECASE)
END = re.compile(rb"\s*end[ \t]*solid\b[^\r\n]*", re.IGNORECASE)
FACET = re.compile(
    rb"\s*facet\b[^\r\n]*\s+outer\s+loop"
    + 3 * rb"\s+vertex[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)[ \t]*(?=[\r\n])"
    + rb"\s+end[ \t]*loop\s+end[ \t]*facet\b",
    re.IGNORECASE,
)
BEGUN = re.compile(rb"(?:^|[\r\n])[ \t]*facet\b", re.IGNORECASE)
NEXT = re.compile(rb"(?:^|[\r\n])[ \t]*(?:solid|facet)\b", re.IGNORECASE)

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Facets:
    """Facets of a text STL file.

    Attributes:
        corners: Positions.
        solids: The solid of each, numbered in the file's order.
        is_ended: Whether the last solid has an end line.
    """

    corners: Float[ndarray, "f 3 3"]
    solids: Int[ndarray, " f"]
    is_ended: bool


def parse_facets(path: Path, data: bytes) -> Facets:
    """Parse the facets of one or several solids; names may be any, and text between and after solids is left out.

    Args:
        path: Names the file in messages.
        data: The file's content, padded by NUL or not.

    Raises:
        InputError: The file ends within a facet, or a facet cannot be read.
    """
    text = data.removeprefix(b"\xef\xbb\xbf").replace(b"\0", b" ").rstrip(b" \t\x1a") + b"\n"
    words: list[bytes] = []
    solids: list[int] = []
    places: list[int] = []
    at, solid, is_open = 0, -1, False
    while True:
        if is_open and (facet := FACET.match(text, at)):
            words += facet.groups()
            solids.append(solid)
            places.append(at)
            at = facet.end()
        elif is_open and (end := END.match(text, at)):
            at, is_open = end.end(), False
        elif begin := BEGIN.match(text, at):
            at, solid, is_open = begin.end(), solid + 1, True
        elif is_open and text[at:].strip():
            raise _unreadable(path, text, at)
        elif is_open or not (following := NEXT.search(text, at)):
            corners = _parse_corners(path, words, text, places)
            return Facets(corners, np.array(solids, dtype=np.int64), not is_open)
        elif following[0].strip().lower() == b"facet":
            raise _unreadable(path, text, following.end() - len(b"facet"))
        else:
            at = following.end() - len(b"solid")


def _unreadable(path: Path, text: bytes, at: int) -> InputError:
    """The error of a file that ends within a facet, or of a line that is no facet's."""
    at += len(text[at:]) - len(text[at:].lstrip())
    begun, ended = len(BEGUN.findall(text)), len(BEGUN.findall(text, 0, at))
    if begun <= ended + 1 and not re.search(rb"end[ \t]*facet", text[at:], re.IGNORECASE):
        if begun > ended:
            return InputError(f"{path} is truncated: it begins {begun} facets and ends {ended}; export it again")
        shown = text[at:].split(None, 1)[0][:40].decode("latin-1")
        return InputError(f"{path} is truncated or damaged: it ends in {shown!r} after {ended} facets; export it again")
    line = len(re.split(rb"\r\n|\r|\n", text[:at]))
    return InputError(
        f"{path} cannot be read as stl: line {line} is not a facet of three vertices of three numbers; export it again"
    )


def _parse_corners(path: Path, words: list[bytes], text: bytes, places: list[int]) -> Float[ndarray, "f 3 3"]:
    try:
        return np.fromiter(map(float, words), dtype=np.float64, count=len(words)).reshape(-1, 3, 3)
    except ValueError:
        number = next(i for i, word in enumerate(words) if not _is_number(word))
    at = text.index(words[number], places[number // 9])
    line = len(re.split(rb"\r\n|\r|\n", text[:at]))
    shown = words[number][:40].decode("latin-1")
    raise InputError(f"{path} has {shown!r} for a number in line {line}: write numbers with a point, as 1.5")


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
