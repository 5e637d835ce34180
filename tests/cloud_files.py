"""Point clouds of a box with labels, normals and colours, and files of them in every format, written by hand."""

import io
import struct
from pathlib import Path

import numpy as np

from jointsdf.data.surface_points import SurfacePoints

COLOURS = np.array([[250, 10, 20], [30, 240, 40]], dtype=np.uint8)  # of the parts 4 and 9


def on_box(count: int = 600, seed: int = 0) -> SurfacePoints:
    """Uniform points of a box of sides 4, 2, 2 about (0.5, 0, 0), in two parts, 4 and 9, cut at x = 0.5."""
    generator = np.random.default_rng(seed)
    half = np.array([2.0, 1.0, 1.0])
    areas = np.repeat([half[1] * half[2], half[0] * half[2], half[0] * half[1]], 2)
    side = generator.choice(6, count, p=areas / areas.sum())
    points = generator.uniform(-half, half, (count, 3))
    axis, sign = side // 2, np.where(side % 2, 1.0, -1.0)
    points[np.arange(count), axis] = sign * half[axis]
    normals = np.zeros((count, 3))
    normals[np.arange(count), axis] = sign
    return SurfacePoints(points + np.array([0.5, 0, 0]), normals, np.where(points[:, 0] > 0, 4, 9))


def colours_of(cloud: SurfacePoints) -> np.ndarray:
    return COLOURS[(cloud.labels == 9).astype(int)]


def as_text(cloud: SurfacePoints, *, normals: bool = True, colours: bool = False, labels: bool = True) -> list[str]:
    """A line per point."""
    parts = [np.char.mod("%.17g", cloud.points)]
    parts += [np.char.mod("%.17g", cloud.normals)] if normals else []
    parts += [np.char.mod("%d", colours_of(cloud))] if colours else []
    parts += [np.char.mod("%d", cloud.labels[:, None])] if labels else []
    return [" ".join(row) for row in np.concatenate(parts, axis=1)]


def ply(cloud: SurfacePoints, *, comments: str = "", more: str = "") -> bytes:
    """A binary PLY file of doubles."""
    names = [f"property double {name}" for name in ("x", "y", "z", "nx", "ny", "nz")]
    names += [f"property uchar {name}" for name in ("red", "green", "blue")] + ["property int part"]
    header = "\n".join(
        ["ply", "format binary_little_endian 1.0", *([comments] if comments else []), f"element vertex {len(cloud)}"]
    )
    kind = np.dtype([("p", "<f8", 6), ("c", "u1", 3), ("l", "<i4")])
    rows = np.zeros(len(cloud), kind)
    rows["p"], rows["c"], rows["l"] = np.c_[cloud.points, cloud.normals], colours_of(cloud), cloud.labels
    return "\n".join([header, *names, *([more] if more else []), "end_header\n"]).encode() + rows.tobytes()


def npy(array: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


def npz(**arrays: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def pcd(cloud: SurfacePoints, data: str, gaps: int = 0) -> bytes:
    """A PCD file with packed colours, padding and labels; with so many points without a place."""
    fields = [("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("_", "u1", (3,)), ("rgb", "<f4"), ("label", "<u4")]
    count = len(cloud) + gaps
    rows = np.zeros(count, np.dtype([(f"{i}", *each[1:]) for i, each in enumerate(fields)]))
    for axis in range(3):
        rows[f"{axis}"] = np.nan
        rows[f"{axis}"][: len(cloud)] = cloud.points[:, axis]
    colours = colours_of(cloud).astype(np.uint32)
    rows["4"][: len(cloud)] = (colours[:, 0] << 16 | colours[:, 1] << 8 | colours[:, 2]).view(np.float32)
    rows["5"][: len(cloud)] = cloud.labels
    lines = ["# .PCD v0.7", "VERSION 0.7", "FIELDS x y z _ rgb label", "SIZE 8 8 8 1 4 4", "TYPE F F F U F U"]
    lines += ["COUNT 1 1 1 3 1 1", f"WIDTH {count}", "HEIGHT 1", f"POINTS {count}", f"DATA {data}", ""]
    header = "\n".join(lines).encode()
    if data == "binary":
        return header + rows.tobytes()
    if data == "binary_compressed":
        flat = b"".join(rows[f"{i}"].tobytes() for i in range(len(fields)))
        packed = lzf_literals(flat)
        return header + struct.pack("<II", len(packed), len(flat)) + packed
    words = [
        " ".join([*(f"{row[f'{axis}']:.17g}" for axis in range(3)), "0 0 0", f"{row['4']:.9g}", f"{row['5']}"])
        for row in rows
    ]
    return header + "\n".join(words).encode()


def lzf_literals(data: bytes) -> bytes:
    """LZF of literal runs alone."""
    return b"".join(bytes([len(run) - 1]) + run for run in (data[k : k + 32] for k in range(0, len(data), 32)))


def written(folder: Path, name: str, content: bytes | list[str]) -> Path:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else "\n".join([*content, ""]).encode())
    return path
