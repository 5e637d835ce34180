"""Table of ABC's archives (chunks): 10,000 models each, one archive per kind of file."""

import csv
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path

from jointsdf.errors import InputError

MODELS_PER_CHUNK = 10_000
MAIN = "0000"  # of all catalogue shapes but one
KINDS = ("obj", "feat", "step")
COLUMNS = ("kind", "chunk", "url", "md5", "bytes")


@dataclass(frozen=True)
class Chunk:
    """One archive on ABC's server.

    Attributes:
        kind: `obj`, `feat` or `step`.
        chunk: Its number, four digits.
        url: Its address.
        md5: Of its content, 32 hexadecimal digits.
        bytes: Its size.
    """

    kind: str
    chunk: str
    url: str
    md5: str
    bytes: int

    @property
    def name(self) -> str:
        """ABC's own name of the archive."""
        return f"abc_{self.chunk}_{self.kind}_v00.7z"


def chunk_of(abc_id: str) -> str:
    """Number of the chunk that holds an ABC model.

    >>> chunk_of("00016513_3d69")
    '0001'
    """
    return f"{int(abc_id[:8]) // MODELS_PER_CHUNK:04d}"


def read_table(override: Path | None = None) -> list[Chunk]:
    """Read the table of the chunks that the catalogue needs.

    Args:
        override: A file of other addresses: either a table with the columns kind, chunk, url, md5, bytes that
            replaces the built-in one, or lines `URL NAME` as in ABC's own lists, which change addresses alone.

    Raises:
        InputError: The file cannot be read, or a line of it is invalid.
    """
    own = resources.files("jointsdf.shapes").joinpath("abc_chunks.csv").read_text(encoding="utf-8")
    chunks = _parse_rows("abc_chunks.csv", own.splitlines())
    if override is None:
        return chunks
    try:
        lines = [line for line in override.read_text(encoding="utf-8").splitlines() if line.strip()]
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"--urls {override} cannot be read: {getattr(error, 'strerror', 'it is no text')}") from error
    if lines and lines[0].split(",")[0].strip() == COLUMNS[0]:
        return _parse_rows(str(override), lines)
    urls = {}
    for number, line in enumerate(lines, 1):
        words = line.split()
        if len(words) != 2:
            raise InputError(f"{override} line {number}: give URL NAME, or a table with columns {','.join(COLUMNS)}")
        urls[words[1]] = _check_url(str(override), number, words[0])
    return [replace(chunk, url=urls.get(chunk.name, chunk.url)) for chunk in chunks]


def _parse_rows(source: str, lines: Iterable[str]) -> list[Chunk]:
    """Parse and check the rows of a table."""
    chunks = []
    for number, row in enumerate(csv.DictReader(lines), 2):
        words = [(row.get(column) or "").strip() for column in COLUMNS]
        kind, chunk, url, md5, size = words
        right = kind in KINDS and re.fullmatch(r"\d{4}", chunk) and re.fullmatch(r"[0-9a-fA-F]{32}", md5)
        if not right or not re.fullmatch(r"[1-9]\d{0,14}", size):
            raise InputError(
                f"{source} line {number}: {','.join(words)!r} is no row of {','.join(COLUMNS)} (kind one of "
                f"{', '.join(KINDS)}; chunk of 4 digits; md5 of 32 hexadecimal digits; bytes above 0)"
            )
        chunks.append(Chunk(kind, chunk, _check_url(source, number, url), md5.lower(), int(size)))
    return chunks


def _check_url(source: str, number: int, url: str) -> str:
    """Return the address, if it is one of the web."""
    if not re.fullmatch(r"https?://\S+", url):
        raise InputError(f"{source} line {number}: {url!r} is no address: it begins with http:// or https://")
    return url


def select_chunks(chunks: Sequence[Chunk], kinds: Sequence[str], numbers: Iterable[str]) -> list[Chunk]:
    """Select the chunks of some kinds and numbers.

    Raises:
        InputError: The table lacks one.
    """
    known = {(chunk.kind, chunk.chunk): chunk for chunk in chunks}
    wanted = [(kind, number) for number in sorted(set(numbers)) for kind in kinds]
    for kind, number in wanted:
        if (kind, number) not in known:
            raise InputError(f"no address of abc_{number}_{kind}_v00.7z is known: give it with --urls, or use --from")
    return [known[key] for key in wanted]
