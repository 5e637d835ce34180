"""Length units of a STEP file (ISO 10303-41), read from its records and rewritten so that the CAD kernel reads them.

OpenCASCADE takes millimetres, without a word, for a unit in terms of another conversion or of a measure in a complex
record, and crashes on a complex record whose parts are not in the order of the alphabet. It is handed the same size in
the one form that it reads right.
"""

import logging
import math
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from jointsdf.errors import InputError
from jointsdf.values import ASSUMED_UNIT

DEEPEST_UNIT = 8  # conversions from a unit to the metre
SMALLEST, LARGEST = 1e-6, 1e3  # metres per unit that the kernel is told; it drops what is below its 1e-7 mm
PREFIXES = {
    "EXA": 1e18, "PETA": 1e15, "TERA": 1e12, "GIGA": 1e9, "MEGA": 1e6, "KILO": 1e3, "HECTO": 1e2, "DECA": 1e1,
    "DECI": 1e-1, "CENTI": 1e-2, "MILLI": 1e-3, "MICRO": 1e-6, "NANO": 1e-9, "PICO": 1e-12, "FEMTO": 1e-15,
    "ATTO": 1e-18,
}  # fmt: skip
SI_METRE = re.compile(r"\bSI_UNIT\s*\(\s*(?:\*\s*,\s*)?(?:\$|\.(\w+)\.)\s*,\s*\.METRE\.\s*\)")
CONVERSION = re.compile(r"\bCONVERSION_BASED_UNIT\s*\([^#]*#(\d+)")
NUMBER = r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[Ee][-+]?\d+)?)"
MEASURE = re.compile(rf"MEASURE_WITH_UNIT\s*\(\s*(?:\w+\s*\(\s*{NUMBER}\s*\)|{NUMBER})\s*,\s*#(\d+)")
CONTEXT = re.compile(r"\bGLOBAL_UNIT_ASSIGNED_CONTEXT\s*\(\s*\(([^)]*)\)")
USED = re.compile(r"\bLENGTH_UNIT\b|SI_UNIT|CONVERSION_BASED_UNIT|MEASURE_WITH_UNIT")
READ_BY_KERNEL = re.compile(
    r"\s*\(\s*LENGTH_UNIT\s*\(\s*\)\s*NAMED_UNIT\s*\(\s*\*\s*\)\s*SI_UNIT\s*\([^()]*\.METRE\.\s*\)\s*\)\s*"
)
HIDDEN = re.compile(r"'[^']*'|/\*.*?\*/", re.DOTALL)

logger = logging.getLogger(__name__)


class Record(NamedTuple):
    """The right side of one record: comments blanked, strings without punctuation, both at their length."""

    text: str
    start: int
    end: int


@dataclass(frozen=True)
class LengthUnits:
    """Length units of a STEP file.

    Attributes:
        metres: Metres per unit, of the unit that most contexts use.
        known: Whether the file names it.
        kernel_metres: Metres per unit that the kernel is told instead, where its precision needs it.
        content: The file's content, in which the kernel reads these units.
    """

    metres: float
    known: bool
    kernel_metres: float
    content: bytes


def read_length_units(path: Path, data: bytes) -> LengthUnits:
    """Read the length units of a STEP file; without any, the millimetre, with a warning.

    Args:
        path: Names the file in messages.
        data: The file's content.

    Raises:
        InputError: A context of the file has a length unit of which no size can be found.
    """
    text = data.decode("latin-1")  # a character per byte
    records, contexts = _find_records(HIDDEN.sub(_hide, text))
    units = {key: _require_metres(path, records, key) for units in contexts for key in units}
    found = Counter(size for units_of_one in contexts for key in units_of_one if (size := units[key]))
    if not found:
        logger.warning("%s: no length unit found: taken to be millimetres", path)
        return LengthUnits(ASSUMED_UNIT.metres, False, ASSUMED_UNIT.metres, data)
    if len(found) > 1:
        sizes = ", ".join(map(str, found))
        logger.warning("%s: several length units (%s m): the one used most is taken", path, sizes)
    metres = found.most_common(1)[0][0]
    kernel_metres = metres if SMALLEST <= metres <= LARGEST else ASSUMED_UNIT.metres
    factor = kernel_metres / metres
    told = {key: size * factor for key, size in units.items() if size and _must_rewrite(records[key], factor)}
    return LengthUnits(metres, True, kernel_metres, _rewrite(text, records, told).encode("latin-1") if told else data)


def _hide(found: re.Match[str]) -> str:
    """Blank a comment, and the punctuation of a string."""
    text = found[0]
    return "'" + re.sub(r"[^\w ]", "_", text[1:-1]) + "'" if text[0] == "'" else " " * len(text)


def _find_records(plain: str) -> tuple[dict[str, Record], list[list[str]]]:
    """Find the records that tell units, by id, and the ids of the units of each context."""
    records: dict[str, Record] = {}
    contexts: list[list[str]] = []
    start = 0
    while (end := plain.find(";", start)) >= 0:
        text = plain[start:end]
        if USED.search(text) and (named := re.match(r"\s*#(\d+)\s*=", text)):
            records.setdefault(named[1], Record(text[named.end() :], start + named.end(), end))
        contexts += [re.findall(r"#(\d+)", units) for units in CONTEXT.findall(text)]
        start = end + 1
    return records, contexts


def _require_metres(path: Path, records: dict[str, Record], key: str) -> float | None:
    """Metres per unit named `#key`, None where it is not a length.

    Raises:
        InputError: It is a length of unknown size.
    """
    metres = _metres(records, key)
    text = records[key].text if key in records else ""
    if metres is None and not re.search(r"\bLENGTH_UNIT\b|\.METRE\.", text):
        return None
    if metres is None or not (metres > 0 and math.isfinite(metres)):
        shown = " ".join(text.split())
        raise InputError(
            f"{path}: its length unit is not understood, #{key}={shown[:100]}: export it again in mm, cm, m or inches"
        )
    return float(f"{metres:.12g}")


def _metres(records: dict[str, Record], key: str, depth: int = 0) -> float | None:
    """Metres per unit named `#key`, None where it is not a length or cannot be followed to the metre."""
    record = records[key].text if key in records else ""
    if si := SI_METRE.search(record):
        return PREFIXES.get(si[1]) if si[1] else 1.0
    factor = CONVERSION.search(record)
    measure = MEASURE.search(records[factor[1]].text) if factor and factor[1] in records else None
    base = _metres(records, measure[3], depth + 1) if measure and depth < DEEPEST_UNIT else None
    return None if base is None or measure is None else float(measure[1] or measure[2]) * base


def _must_rewrite(record: Record, factor: float) -> bool:
    return factor != 1 or not READ_BY_KERNEL.fullmatch(record.text)


def _rewrite(text: str, records: dict[str, Record], sizes: dict[str, float]) -> str:
    """Replace the units of the given ids by conversions from the metre, of the given sizes in metres."""
    free = max(int(key) for key in re.findall(r"#(\d{1,9})\b", text)) + 1
    pieces: list[str] = []
    end = len(text)
    for key in sorted(sizes, key=lambda key: -records[key].start):
        unit = (
            f"(CONVERSION_BASED_UNIT('UNIT',#{free})LENGTH_UNIT()NAMED_UNIT(*));"
            f"#{free}=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE({_real(sizes[key])}),#{free + 1});"
            f"#{free + 1}=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT($,.METRE.))"
        )
        pieces += [text[records[key].end : end], unit]
        end, free = records[key].start, free + 2
    return "".join([text[:end], *reversed(pieces)])


def _real(value: float) -> str:
    """A number as ISO 10303-21 writes reals: with a point.

    >>> _real(1e-06), _real(0.0254)
    ('1.0E-06', '0.0254')
    """
    text = repr(value).upper()
    return text if "." in text else text.replace("E", ".0E")
