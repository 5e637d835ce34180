"""Decompression of LZF (LibLZF, M. Lehmann): literal runs and references to earlier bytes."""

LITERALS = 32  # control bytes below are lengths of runs of literals, less one
LONG = 7  # length, in a control byte, that a further byte adds to
LEAST_COPY = 2  # added to the length of each reference


def decompress(data: bytes, size: int) -> bytes:
    """Decompress a block.

    Args:
        data: The compressed bytes.
        size: Of the decompressed block.

    Raises:
        ValueError: The block is damaged, or of another size.

    >>> decompress(bytes([1, 97, 98, 0x60, 1]), 7)
    b'abababa'
    """
    out, at = bytearray(), 0
    try:
        while at < len(data):
            control = data[at]
            at += 1
            if control < LITERALS:
                if at + control >= len(data):
                    raise ValueError("the block ends within a run of literals")
                out += data[at : at + control + 1]
                at += control + 1
                continue
            length = control >> 5
            if length == LONG:
                length += data[at]
                at += 1
            first = len(out) - ((control & 31) << 8) - data[at] - 1
            at += 1
            left = length + LEAST_COPY
            if first < 0 or len(out) + left > size:
                raise ValueError("a reference reaches out of the block")
            piece = out[first : first + left]  # a reference may reach into what it writes: the piece repeats
            out += (piece * (left // len(piece) + 1))[:left]
    except IndexError as error:
        raise ValueError("the block ends within a reference") from error
    if len(out) != size:
        raise ValueError(f"{len(out)} bytes for {size}")
    return bytes(out)
