"""What a file holds, by its first bytes, for messages about files that cannot be read as labels."""

from jointsdf.shapes.readers.formats import UNREAD
from jointsdf.shapes.readers.recognition import recognise

KINDS = (  # first bytes and what begins with them, besides what can be a shape
    (b"\x93NUMPY", "a .npy array"),
    (b"PK\x03\x04", "a zip archive (.npz?)"),
    (b"\x89HDF", "an HDF5 file"),
    (b"MATLAB", "a MATLAB file"),
    *((bytes([0x80, protocol]), "a Python pickle, which is never read") for protocol in range(2, 6)),
)
TEXT = ("json", "utf16", "yml", "csv")  # what the recognition of formats finds in label files
SPACE = b" \t\r\n\0"


def describe_content(data: bytes) -> str:
    """Say what a file holds, as in "it is .."; from its content alone.

    >>> describe_content(b"1, 2")
    'text'
    """
    if not data.strip(SPACE):
        return "empty"
    for start, kind in KINDS:
        if data.startswith(start):
            return kind
    if (held := recognise(data)) and held not in TEXT:
        return UNREAD[held].name if held in UNREAD else f"a mesh or CAD file ({held.upper()})"
    return "binary, of no known kind" if decode_text(data) is None else "text"


def decode_text(data: bytes) -> str | None:
    """Decode UTF-8 or, by its mark, UTF-16; None where it is neither, or holds a zero."""
    is_wide = data.startswith((b"\xff\xfe", b"\xfe\xff"))
    try:
        text = data.decode("utf-16" if is_wide else "utf-8-sig")
    except UnicodeDecodeError:
        return None
    return None if "\0" in text else text
