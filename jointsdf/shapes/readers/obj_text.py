"""Text of an OBJ file: its encoding, and its lines, of which some go on in the next."""

import codecs
import re

BYTE_ORDER_MARKS = ((codecs.BOM_UTF8, "utf-8"), (codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be"))


def decode(data: bytes) -> str:
    """Decode text by its byte order mark; without one it is UTF-8 or, where that fails, Latin-1."""
    for mark, encoding in BYTE_ORDER_MARKS:
        if data.startswith(mark):
            return data[len(mark) :].decode(encoding, errors="replace")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def split_lines(text: str) -> list[str]:
    r"""Split text into lines; a line that ends in a backslash goes on, and leaves the following lines empty.

    >>> split_lines("f 1 \\\r\n2 3\rv")
    ['f 1  2 3', '', 'v']
    """
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    if "\\" in text:
        text = re.sub(r"(?m)^[ \t]*#.*$", "", text)  # a comment may end in a path of Windows
        text = re.sub(
            r"(?:[^\n]*\\[ \t]*\n)+[^\n]*",
            lambda found: re.sub(r"\\[ \t]*\n", " ", found[0]) + "\n" * found[0].count("\n"),
            text,
        )
    return text.split("\n")
