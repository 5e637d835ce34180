"""Length units of files: by their size, and as the user gives them."""

import logging
import math

from jointsdf.errors import InputError
from jointsdf.values import Unit

METRES = {
    "mm": 1e-3, "cm": 1e-2, "m": 1.0, "um": 1e-6, "in": 0.0254, "ft": 0.3048,
    "nm": 1e-9, "dm": 0.1, "km": 1e3, "mil": 2.54e-5, "yd": 0.9144,
}  # fmt: skip
AUTO = "auto"  # the file's own unit, else the assumed one
GIVEN = {**{name: name for name in ("mm", "cm", "m", "um", "in", "ft")}, "inch": "in"}  # what the user may write

logger = logging.getLogger(__name__)


def unit_of_metres(metres: float) -> Unit:
    """The length unit of a size in metres; one without a symbol is named by its size.

    >>> unit_of_metres(0.0254).name, unit_of_metres(0.5).name
    ('in', '0.5m')
    """
    names = (name for name, size in METRES.items() if math.isclose(size, metres, rel_tol=1e-9))
    return Unit(next(names, f"{metres:.12g}m"), metres)


def choose_unit(source: str, own: Unit, given: str) -> Unit:
    """Choose the unit of a file: the one that the user gives, else its own, else the assumed one.

    A user who contradicts the file is believed, with a warning: many programs write millimetres into glTF files, which
    are in metres.

    Args:
        source: Names the file in messages.
        own: The unit that the file declares, or the assumed one.
        given: A key of `GIVEN`, or `auto`.

    Raises:
        InputError: An unknown name.
    """
    if given == AUTO:
        return own
    if given not in GIVEN:
        raise InputError(f"unit={given}: give one of {', '.join(GIVEN)}, or {AUTO}")
    unit = Unit(GIVEN[given], METRES[GIVEN[given]])
    if own.known and not math.isclose(own.metres, unit.metres, rel_tol=1e-6):
        logger.warning("%s: unit=%s is taken, although the file says that it is in %s", source, given, own.name)
    return unit
