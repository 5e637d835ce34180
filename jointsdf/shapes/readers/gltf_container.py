"""Container of a glTF file, binary or text: its JSON and its buffers, from chunks, data URIs and files beside it.

Format: Khronos, "glTF 2.0 Specification", sections 3.6 (buffers) and 4 (GLB).
"""

import base64
import hashlib
import json
import struct
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import NamedTuple
from urllib.parse import unquote, unquote_to_bytes

from jointsdf.errors import InputError
from jointsdf.shapes.readers.gltf_json import Json, entries, integer, nested

MAGIC, JSON_CHUNK, BINARY_CHUNK = b"glTF", b"JSON", b"BIN\0"
HEADER, CHUNK_HEADER = 12, 8  # bytes


class Container(NamedTuple):
    """Content of a glTF file.

    Attributes:
        document: Its JSON.
        buffers: Bytes of each buffer, none for one without content, which an extension may fill.
        sha256: Of the content and the buffers, where some of these are files of their own; else "".
    """

    document: Json
    buffers: list[bytes]
    sha256: str


def open_container(path: Path, data: bytes) -> Container:
    """Take a file apart.

    Args:
        path: Buffers in files are sought in its folder.
        data: Content, of a GLB file where it begins like one.

    Raises:
        InputError: It is of version 1, or a file beside it is missing, or not to be read.
        ValueError: It is damaged or truncated; the message says where.
    """
    text, binary = _split_chunks(path, data) if data.startswith(MAGIC) else (data, None)
    try:
        document = json.loads(text.decode("utf-8-sig"))
    except RecursionError:
        raise ValueError("its JSON is nested too deep") from None
    except UnicodeDecodeError:
        raise ValueError("it is neither binary glTF nor JSON") from None
    except json.JSONDecodeError as error:
        raise ValueError(f"its JSON is cut or damaged ({error})") from None
    if not isinstance(document, dict):
        raise ValueError("its JSON is no object")
    version = str(nested(document, "asset").get("version", "2.0"))
    if not version.startswith("2."):
        raise _of_other_version(path, version)
    buffers = [
        _check_length(number, buffer, _load_buffer(path, buffer, binary if number == 0 else None))
        for number, buffer in enumerate(entries(document, "buffers"))
    ]
    beside = any(not str(buffer.get("uri", "data:")).startswith("data:") for buffer in entries(document, "buffers"))
    return Container(document, buffers, hashlib.sha256(data + b"".join(buffers)).hexdigest() if beside else "")


def _split_chunks(path: Path, data: bytes) -> tuple[bytes, bytes | None]:
    """Split a GLB file into its JSON and its binary chunk."""
    if len(data) < HEADER:
        raise ValueError("its header is cut")
    version, length = struct.unpack_from("<II", data, len(MAGIC))
    if version != 2:
        raise _of_other_version(path, str(version))
    if length > len(data):
        raise ValueError(f"it is truncated: it declares {length} bytes and holds {len(data)}")
    if length < len(data):
        raise ValueError(f"it declares {length} bytes and holds {len(data)}")
    chunks: dict[bytes, bytes] = {}
    at = HEADER
    while at < length:
        size = int.from_bytes(data[at : at + 4], "little")
        end = at + CHUNK_HEADER + size
        if at + CHUNK_HEADER > length or end > length:
            raise ValueError(f"a chunk of {size} bytes goes beyond its end")
        chunks.setdefault(data[at + 4 : at + CHUNK_HEADER], data[at + CHUNK_HEADER : end])
        at = end
    if JSON_CHUNK not in chunks:
        raise ValueError("it has no JSON chunk")
    return chunks[JSON_CHUNK], chunks.get(BINARY_CHUNK)


def _load_buffer(path: Path, buffer: Json, binary: bytes | None) -> bytes | None:
    """Load a buffer; None where it has no content."""
    uri = buffer.get("uri")
    if uri is None:
        return binary
    if not isinstance(uri, str):
        raise ValueError("the uri of a buffer is no text")
    if uri.startswith("data:"):
        kind, comma, content = uri.partition(",")
        if not comma:
            raise ValueError("a data URI has no content")
        encoded = unquote_to_bytes(content)
        return base64.b64decode(encoded, validate=True) if kind.endswith(";base64") else encoded
    return _read_sibling(path, unquote(uri))


def _read_sibling(path: Path, name: str) -> bytes:
    """Read a file beside a glTF file, or in a folder below."""
    parts = PurePosixPath(name).parts
    outside = not parts or parts[0] == "/" or ".." in parts or "\0" in name
    if outside or ":" in name or PureWindowsPath(name).drive or "\\" in name:
        raise InputError(f"{path} names the buffer {name[:60]!r}: put the file beside it and name it without folders")
    sibling = path.parent / name
    if not sibling.is_file():
        raise InputError(f"{path} needs {name[:60]!r} beside it, which is not there: copy both, or export it as GLB")
    try:
        return sibling.read_bytes()
    except OSError as error:
        raise InputError(f"{sibling} cannot be opened: {error.strerror}") from error


def _check_length(number: int, buffer: Json, content: bytes | None) -> bytes:
    """Check that a buffer that has content has all of it."""
    length = integer(buffer, "byteLength", least=1)
    if content is not None and length > len(content):
        raise ValueError(f"it is truncated: buffer {number} declares {length} bytes and holds {len(content)}")
    return b"" if content is None else content[:length]


def _of_other_version(path: Path, version: str) -> InputError:
    return InputError(f"{path} is glTF of version {version[:20]!r}, only 2.0 is read: convert or export it again")
