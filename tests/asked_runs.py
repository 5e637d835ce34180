"""A small field in a run folder, and the commands that ask it."""

import numpy as np
from click.testing import CliRunner, Result

from jointsdf.cli import main
from jointsdf.values import Normalisation, Unit

FRAME = Normalisation(np.array([100.0, -20.0, 3.5]), 10.0)
PARTS = (3, 40)
INCH = Unit("in", 0.0254)
RADIUS = 5.0  # file units


def ask(*words: object) -> Result:
    """`jointsdf <words>` in this process."""
    return CliRunner().invoke(main, [str(word) for word in words])
