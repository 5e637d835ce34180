"""Reader of STEP files as triangles in the file's length unit, each with its B-rep face."""

import importlib.util
import io
import logging
import re
import subprocess
import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.errors import InputError, require_number

MILLIMETRE = 1e-3  # metres
DEEPEST_UNIT = 5  # conversions from a unit to the metre
PREFIXES = {
    "EXA": 1e18, "PETA": 1e15, "TERA": 1e12, "GIGA": 1e9, "MEGA": 1e6, "KILO": 1e3, "HECTO": 1e2, "DECA": 1e1,
    "DECI": 1e-1, "CENTI": 1e-2, "MILLI": 1e-3, "MICRO": 1e-6, "NANO": 1e-9, "PICO": 1e-12, "FEMTO": 1e-15,
    "ATTO": 1e-18,
}  # fmt: skip
SI_METRE = re.compile(r"\bSI_UNIT\s*\(\s*(?:\$|\.(\w+)\.)\s*,\s*\.METRE\.\s*\)")
CONVERSION = re.compile(r"\bCONVERSION_BASED_UNIT\s*\([^#]*#(\d+)")
MEASURE = re.compile(r"MEASURE_WITH_UNIT\s*\(\s*\w+\s*\(\s*(\d+\.?\d*(?:[Ee][-+]?\d+)?)\s*\)\s*,\s*#(\d+)")
CONTEXT = re.compile(r"\bGLOBAL_UNIT_ASSIGNED_CONTEXT\s*\(\s*\(([^)]*)\)")

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class StepMesh:
    """The tessellated solids of one STEP file.

    Attributes:
        vertices: Positions in the file's length unit; one per position of each body.
        faces: Vertex indices, none degenerate.
        patches: The B-rep face of each triangle, numbered through all bodies of the file.
        surfaces: Analytic type of each B-rep face: plane, cylinder, cone, sphere, torus, or other.
        unit: Metres per length unit of the file.
    """

    vertices: Float[ndarray, "v 3"]
    faces: Int[ndarray, "f 3"]
    patches: Int[ndarray, " f"]
    surfaces: tuple[str, ...]
    unit: float


@dataclass(frozen=True)
class Tessellation:
    """Resolution of a STEP file's triangles.

    Attributes:
        tolerance: Largest distance from the true surface, relative to the longest side of the file's box.
        angle: Largest angle between neighbouring chords of a curve, radians.

    Raises:
        InputError: A value out of its range.
    """

    tolerance: float = 1e-4
    angle: float = 0.1

    def __post_init__(self) -> None:
        """Check the ranges."""
        require_number("tessellation.tolerance", self.tolerance, 1e-6, 0.1)
        require_number("tessellation.angle", self.angle, 1e-3, 1.0)


DEFAULT = Tessellation()


def read_step(path: Path, data: bytes, tessellation: Tessellation = DEFAULT) -> StepMesh:
    """Tessellate a STEP file.

    Args:
        path: Names the file in messages.
        data: Its content.
        tessellation: Resolution of the triangles.

    Raises:
        InputError: The content is no STEP file, truncated, damaged, or without a surface; or cascadio, which reads
            STEP, is not installed.
    """
    if not data.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"ISO-10303-21"):
        raise InputError(f"{path} is no STEP file: it does not begin with ISO-10303-21; export it again")
    if b"END-ISO-10303-21" not in data:
        raise InputError(f"{path} is truncated: END-ISO-10303-21 is missing; export it again")
    if importlib.util.find_spec("cascadio") is None:
        raise InputError(f"{path}: STEP needs cascadio: pip install 'jointsdf[step]' (in a checkout '.[step]')")
    arrays = _run_worker(path, data, tessellation)
    corners = arrays["vertices"][arrays["faces"]]
    if not np.isfinite(corners).all() or not np.ptp(corners, axis=1).any():
        raise InputError(f"{path} is damaged: it has infinite coordinates or no extent; export it again")
    unit = parse_length_unit(path, data.decode("utf-8", errors="replace"))
    vertices, faces, patches = weld(arrays["vertices"], arrays["faces"], arrays["patches"])
    return StepMesh(vertices / unit, faces, patches, tuple(str(each) for each in arrays["surfaces"]), unit)


def _run_worker(path: Path, data: bytes, tessellation: Tessellation) -> dict[str, ndarray]:
    """Run `step_worker.py` on the file, in a process of its own; positions in metres."""
    script = str(Path(__file__).with_name("step_worker.py"))
    command = [sys.executable, "-P", script, str(tessellation.tolerance), str(tessellation.angle)]
    done = subprocess.run(command, input=data, capture_output=True, check=False)
    messages = re.sub(r"\x1b\[[\d;]*m", "", done.stderr.decode("utf-8", errors="replace"))
    if done.returncode > 0:
        last = (messages.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
        raise InputError(f"{path} cannot be tessellated: {last}")
    if done.returncode < 0:
        raise InputError(
            f"{path} is damaged: the STEP reader crashed on it (signal {-done.returncode}); export it again"
        )
    if not done.stdout:
        raise InputError(f"{path} is damaged or holds no surface: nothing could be read from it; export it again")
    if "Fails Count" in messages:
        logger.warning("%s: damaged in places (syntax or references): some surfaces may be missing", path)
    with np.load(io.BytesIO(done.stdout), allow_pickle=False) as arrays:
        return dict(arrays)


def weld(
    vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], patches: Int[ndarray, " f"]
) -> tuple[Float[ndarray, "w 3"], Int[ndarray, "g 3"], Int[ndarray, " g"]]:
    """Merge the vertices of each body by position, and drop degenerate triangles.

    Bodies that touch stay apart, so that each is closed.

    Args:
        vertices: Positions, equal ones bit by bit.
        faces: Vertex indices.
        patches: The patch of each face; those of a body follow each other.

    Returns:
        Vertices, faces and patches.
    """
    positions, index = np.unique(vertices, axis=0, return_inverse=True)
    merged = index.reshape(-1)[faces]
    proper = (merged != np.roll(merged, 1, axis=1)).all(axis=1)
    merged, patches = merged[proper], patches[proper]
    corners = np.column_stack([np.repeat(_find_bodies(merged, patches), 3), merged.ravel()])
    used, index = np.unique(corners, axis=0, return_inverse=True)
    return positions[used[:, 1]], index.reshape(-1, 3), patches


def _find_bodies(faces: Int[ndarray, "f 3"], patches: Int[ndarray, " f"]) -> Int[ndarray, " f"]:
    """Find the body of each face: one ends at each patch that leaves no edge without its second face."""
    ends = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    owners = np.repeat(patches, 3)
    order = np.lexsort((owners, ends[:, 1], ends[:, 0]))
    ends, owners = ends[order], owners[order]
    same = np.append((ends[1:] == ends[:-1]).all(axis=1), False)  # whether the next use is of the same edge
    places = np.arange(len(ends))
    starts = np.maximum.accumulate(np.where(np.append(True, ~same[:-1]), places, 0))
    opens = np.flatnonzero(same & ((places - starts) % 2 == 0))
    count = int(patches.max()) + 1
    waiting = np.cumsum(np.bincount(owners[opens], minlength=count) - np.bincount(owners[opens + 1], minlength=count))
    return np.append(0, np.cumsum(waiting == 0)[:-1])[patches]


def parse_length_unit(path: Path, text: str) -> float:
    """Parse the length unit of a STEP file, in metres: of several, that of most contexts; without any, the millimetre.

    Args:
        path: Names the file in messages.
        text: The file's content.
    """
    plain = re.sub(r"'[^']*'|/\*.*?\*/", "", text, flags=re.DOTALL)
    records = {}
    contexts = []
    for record in plain.split(";"):
        if re.search(r"\bLENGTH_UNIT\b|MEASURE_WITH_UNIT", record) and (named := re.match(r"\s*#(\d+)\s*=", record)):
            records[named[1]] = record
        contexts += [re.findall(r"#(\d+)", units) for units in CONTEXT.findall(record)]
    lengths = (_metres(records, key) for units in contexts for key in units)
    found = Counter(float(f"{metres:.12g}") for metres in lengths if metres)
    if not found:
        logger.warning("%s: no length unit found: taken to be millimetres", path)
        return MILLIMETRE
    if len(found) > 1:
        logger.warning("%s: several length units (%s m): the one used most is taken", path, ", ".join(map(str, found)))
    return found.most_common(1)[0][0]


def _metres(records: dict[str, str], key: str, depth: int = 0) -> float | None:
    """Metres per unit named `#key`, None where it is not a length."""
    record = records.get(key, "")
    if si := SI_METRE.search(record):
        return PREFIXES.get(si[1]) if si[1] else 1.0
    measure = MEASURE.search(records.get(found[1], "") if (found := CONVERSION.search(record)) else "")
    base = _metres(records, measure[2], depth + 1) if measure and depth < DEEPEST_UNIT else None
    return float(measure[1]) * base if measure and base else None
