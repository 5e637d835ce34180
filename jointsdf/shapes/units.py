"""Length units of files by their size."""

import math

from jointsdf.values import Unit

METRES = {
    "mm": 1e-3, "cm": 1e-2, "m": 1.0, "um": 1e-6, "in": 0.0254, "ft": 0.3048,
    "nm": 1e-9, "dm": 0.1, "km": 1e3, "mil": 2.54e-5, "yd": 0.9144,
}  # fmt: skip


def unit_of_metres(metres: float) -> Unit:
    """The length unit of a size in metres; one without a symbol is named by its size.

    >>> unit_of_metres(0.0254).name, unit_of_metres(0.5).name
    ('in', '0.5m')
    """
    names = (name for name, size in METRES.items() if math.isclose(size, metres, rel_tol=1e-9))
    return Unit(next(names, f"{metres:.12g}m"), metres)
