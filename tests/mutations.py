"""Mutations of files, as transfers, editors and exporters damage them: flipped bits, cuts, swapped and odd tokens."""

import re
from collections.abc import Callable

import numpy as np

NUMBER = re.compile(rb"(?<![\w.])[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?(?![\w.])")
ODD_NUMBERS = (b"nan", b"-1", b"0", b"1e300", b"-1e-300", b"4294967295", b"99999999999999999999", b"1,5", b"0x1f", b"")
TOKEN = re.compile(rb"[^\s,;()\[\]{}:]+")


def flip_bits(data: bytes, draw: np.random.Generator) -> bytes:
    """Flip one to eight bits."""
    array = np.frombuffer(data, dtype=np.uint8).copy()
    places = draw.integers(len(array), size=draw.integers(1, 9))
    array[places] ^= np.uint8(1) << draw.integers(8, size=len(places), dtype=np.uint8)
    return array.tobytes()


def cut(data: bytes, draw: np.random.Generator) -> bytes:
    """Cut off the end."""
    return data[: draw.integers(len(data))]


def lose_a_piece(data: bytes, draw: np.random.Generator) -> bytes:
    """Leave out up to 64 bytes anywhere."""
    start = int(draw.integers(len(data)))
    return data[:start] + data[start + int(draw.integers(1, 65)) :]


def repeat_a_piece(data: bytes, draw: np.random.Generator) -> bytes:
    """Write up to 64 bytes twice."""
    start = int(draw.integers(len(data)))
    return data[:start] + data[start : start + int(draw.integers(1, 65))] + data[start:]


def swap_tokens(data: bytes, draw: np.random.Generator) -> bytes:
    """Swap two words."""
    words = [match.span() for match in TOKEN.finditer(data)]
    if len(words) < 2:
        return flip_bits(data, draw)
    (a, b), (c, d) = sorted(words[int(i)] for i in draw.choice(len(words), 2, replace=False))
    return data[:a] + data[c:d] + data[b:c] + data[a:b] + data[d:]


def write_an_odd_number(data: bytes, draw: np.random.Generator) -> bytes:
    """Replace a number by one that no file should hold; in a binary file four bytes by ones or zeros."""
    numbers = [match.span() for match in NUMBER.finditer(data)]
    if not numbers or (b"\x00" in data[:4096] and draw.random() < 0.5):
        start = int(draw.integers(max(len(data) - 4, 1)))
        return (
            data[:start]
            + draw.choice([b"\xff\xff\xff\xff", b"\x00\x00\x00\x00", b"\x00\x00\xc0\x7f"])
            + data[start + 4 :]
        )
    start, end = numbers[int(draw.integers(len(numbers)))]
    return data[:start] + ODD_NUMBERS[int(draw.integers(len(ODD_NUMBERS)))] + data[end:]


MUTATIONS: tuple[Callable[[bytes, np.random.Generator], bytes], ...] = (
    flip_bits,
    cut,
    swap_tokens,
    write_an_odd_number,
    lose_a_piece,
    repeat_a_piece,
)


def mutate(data: bytes, number: int) -> tuple[str, bytes]:
    """One mutation of a file, the same for the same number; also its name."""
    draw = np.random.default_rng(number)
    chosen = MUTATIONS[number % len(MUTATIONS)]
    return chosen.__name__, chosen(data, draw)
