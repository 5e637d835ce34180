"""glTF files, made in a few lines: accessors over one buffer, meshes, nodes."""

import base64
import json
import struct
from typing import Any

import numpy as np

CODES = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126}
TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}


class GltfFile:
    """A glTF file under construction."""

    def __init__(self, **document: Any) -> None:
        self.binary = bytearray()
        self.document: dict[str, Any] = {
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}],
            "nodes": [], "meshes": [], "accessors": [], "bufferViews": [], **document,
        }  # fmt: skip

    def _put(self, key: str, entry: dict[str, Any]) -> int:
        self.document[key].append(entry)
        return len(self.document[key]) - 1

    def view(self, content: bytes, **fields: Any) -> int:
        self.binary += bytes(-len(self.binary) % 4)
        where = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(content)}
        self.binary += content
        return self._put("bufferViews", where | fields)

    def accessor(self, values: np.ndarray, padding: int = 0, **fields: Any) -> int:
        """Adds an array, each of its rows followed by some bytes of padding."""
        rows = values.reshape(len(values), -1)
        content = b"".join(row.tobytes() + b"\xaa" * padding for row in rows)
        stride = {"byteStride": rows[0].nbytes + padding} if padding else {}
        about = {"componentType": CODES[values.dtype.name], "count": len(rows), "type": TYPES[rows.shape[1]]}
        return self._put("accessors", {"bufferView": self.view(content, **stride), **about, **fields})

    def primitive(self, positions: np.ndarray, indices: np.ndarray | None = None, **fields: Any) -> dict[str, Any]:
        found: dict[str, Any] = {"attributes": {"POSITION": self.accessor(positions)}}
        if indices is not None:
            found["indices"] = self.accessor(indices.ravel())
        return found | fields

    def mesh(self, *primitives: dict[str, Any], **fields: Any) -> int:
        return self._put("meshes", {"primitives": list(primitives), **fields})

    def node(self, *, root: bool = True, **fields: Any) -> int:
        index = self._put("nodes", fields)
        if root:
            self.document["scenes"][0]["nodes"].append(index)
        return index

    def glb(self) -> bytes:
        if self.binary:
            self.document["buffers"] = [{"byteLength": len(self.binary)}]
        return pack(json.dumps(self.document).encode(), bytes(self.binary))

    def gltf(self, uri: str | None = None) -> bytes:
        """Text with the buffer under a uri, or within it."""
        uri = uri or "data:application/octet-stream;base64," + base64.b64encode(self.binary).decode()
        return json.dumps(self.document | {"buffers": [{"byteLength": len(self.binary), "uri": uri}]}).encode()


def pack(text: bytes, binary: bytes = b"", version: int = 2) -> bytes:
    """A GLB file of a JSON chunk and, unless it is empty, a binary chunk."""
    text += b" " * (-len(text) % 4)
    binary += bytes(-len(binary) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    if binary:
        chunks += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", version, 12 + len(chunks)) + chunks
