"""A cube cut by a plane: volume, first moments and area of the cut, in closed form.

The part of the unit cube with m . y < a, all m > 0, has the volume

    V = sum over corners s of (-1)^|s| (a - m . s)_+^3 / (6 m_1 m_2 m_3)

(Scardovelli and Zaleski, "Analytical relations connecting linear interfaces and volume fractions in rectangular grids",
2000). The area of the cut is |m| dV/da, and the first moments are minus the derivatives by m of the integral of V.
"""

from itertools import product
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpy import ndarray

CORNERS = np.array(list(product((0.0, 1.0), repeat=3)))
SIGNS = (-1.0) ** CORNERS.sum(axis=1)
LEAST = 1e-3  # of a slope, of their sum: smaller ones are divided by, and move the cut by less than half of this


class CutCubes(NamedTuple):
    """Unit cubes cut by planes.

    Attributes:
        volume: Of the part with negative values, 0..1.
        moment: Integral of that part's position, about the middle of the cube.
        area: Of the cut.
    """

    volume: Float[ndarray, " n"]
    moment: Float[ndarray, "n 3"]
    area: Float[ndarray, " n"]


def cut_cubes(values: Float[ndarray, " n"], slopes: Float[ndarray, "n 3"]) -> CutCubes:
    """Cut unit cubes by the planes where linear functions are 0.

    Args:
        values: Of the function at the middle of each cube.
        slopes: Its derivatives, per side of the cube.

    >>> half = cut_cubes(np.array([0.0]), np.array([[0.0, 2.0, 0.0]]))
    >>> half.volume.round(6), half.moment.round(3) + 0.0, half.area.round(4)
    (array([0.5]), array([[ 0.   , -0.125,  0.   ]]), array([1.]))
    """
    sizes = np.abs(slopes).sum(axis=1)
    cut = (np.abs(values) < sizes / 2) & (sizes > 0)
    volume, moment, area = np.where(values < 0, 1.0, 0.0), np.zeros_like(slopes), np.zeros_like(values)
    scale = sizes[cut, None]
    m = np.maximum(np.abs(slopes[cut]) / scale, LEAST)
    a = m.sum(axis=1) / 2 - values[cut] / scale[:, 0]
    s = np.maximum(a[:, None] - m @ CORNERS.T, 0)
    of_volume = SIGNS * s**3 / (6 * m.prod(axis=1)[:, None])
    volume[cut] = np.clip(of_volume.sum(axis=1), 0, 1)
    of_first = of_volume @ CORNERS + (of_volume * s).sum(axis=1)[:, None] / (4 * m)
    moment[cut] = np.where(slopes[cut] < 0, -1, 1) * (of_first - volume[cut, None] / 2)
    slope = (SIGNS * s**2).sum(axis=1) / (2 * m.prod(axis=1))
    area[cut] = np.linalg.norm(m, axis=1) * np.maximum(slope, 0)
    return CutCubes(volume, moment, area)
