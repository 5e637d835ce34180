"""Length units of files by name and by size."""

import math

from jointsdf.errors import InputError
from jointsdf.values import ASSUMED_UNIT, Unit

METRES = {
    "mm": 1e-3, "cm": 1e-2, "m": 1.0, "um": 1e-6, "in": 0.0254, "ft": 0.3048,
    "nm": 1e-9, "dm": 0.1, "km": 1e3, "mil": 2.54e-5, "yd": 0.9144,
}  # fmt: skip
GIVEN = ("mm", "cm", "m", "um", "in", "ft")  # that a user may name


def unit_of_metres(metres: float) -> Unit:
    """The length unit of a size in metres; one without a symbol is named by its size.

    >>> unit_of_metres(0.0254).name, unit_of_metres(0.5).name
    ('in', '0.5m')
    """
    names = (name for name, size in METRES.items() if math.isclose(size, metres, rel_tol=1e-9))
    return Unit(next(names, f"{metres:.12g}m"), metres)


def choose_unit(source: str, own: Unit | None, given: str | None) -> Unit:
    """Choose the unit of a file: its own, else the one that the user gives, else the assumed millimetre.

    Args:
        source: Names the file in messages.
        own: The unit that the file declares.
        given: A name of `GIVEN`.

    Raises:
        InputError: An unknown name, or one that contradicts the file.
    """
    if given is None:
        return own or ASSUMED_UNIT
    if given not in GIVEN:
        raise InputError(f"unit={given}: give one of {', '.join(GIVEN)}, or leave it out")
    unit = Unit(given, METRES[given])
    if own is not None and own.known and not math.isclose(own.metres, unit.metres, rel_tol=1e-6):
        raise InputError(f"{source}: unit={given} contradicts the file, which is in {own.name}: leave unit= out")
    return unit
