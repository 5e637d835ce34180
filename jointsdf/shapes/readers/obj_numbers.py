"""Numbers of the lines of a text, all at once, or what is wrong with the first line that has none."""

import re
from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Int, Shaped
from numpy import ndarray

LONGEST_WORD = 20  # characters quoted in a message


class LineError(ValueError):
    """A line cannot be parsed.

    Attributes:
        line: Its index.
    """

    def __init__(self, line: int, words: str) -> None:
        super().__init__(words)
        self.line = line


def parse_lines(
    lines: Sequence[str], kind: Callable[[str], float], least: int, end: str = ""
) -> tuple[Shaped[ndarray, " n"], Int[ndarray, " l"]]:
    """Parse lines of numbers between spaces.

    Args:
        lines: Any number of them.
        kind: `int` or `float`, which every word must be.
        least: Smallest number of words of a line.
        end: Character that ends the number within a word, if any.

    Returns:
        The numbers of all lines, and how many each has.

    Raises:
        LineError: For the first line that has too few words, or a word that is no number.
    """
    sizes = np.array([len(line.split()) for line in lines], dtype=np.int64)
    words = " ".join(lines).split()  # one list of words, not one a line, which would cost three times as much
    if end:
        words = [word.partition(end)[0] for word in words]
    short = np.flatnonzero(sizes < least)
    try:
        values = np.fromiter(map(kind, words), dtype=np.float64 if kind is float else np.int64, count=len(words))
        wrong = next((at for at, word in enumerate(words) if "_" in word), None)  # Python's digit separator
    except (ValueError, OverflowError):
        wrong = next(at for at, word in enumerate(words) if not _is_number(word, kind))
    if wrong is not None and (not len(short) or sizes[: short[0] + 1].sum() > wrong):
        line = int(np.searchsorted(np.cumsum(sizes), wrong, side="right"))
        raise LineError(line, f"{words[wrong][:LONGEST_WORD]!r} {_explain(words[wrong])}")
    if len(short):
        raise LineError(int(short[0]), f"{sizes[short[0]]} numbers where at least {least} are needed (truncated?)")
    return values, sizes


def _is_number(word: str, kind: Callable[[str], float]) -> bool:
    """True if a word is a number, an integer of 64 bits."""
    try:
        return "_" not in word and (kind(word) is not None if kind is float else abs(kind(word)) < 2**63)
    except ValueError:
        return False


def _explain(word: str) -> str:
    """What is wrong with a word that is no number."""
    if re.fullmatch(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?", word):
        return "has a decimal comma: a decimal point is needed"
    if re.fullmatch(r"[-+]?\d*\.?\d*[dD][-+]?\d+", word):
        return "has an exponent after D: one after E is needed"
    return "is no number"
