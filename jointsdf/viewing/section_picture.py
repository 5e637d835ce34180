"""Picture of a section of a field: bands and isolines of the signed distance, with a scale."""

from typing import Any

import numpy as np
from jaxtyping import Float, UInt8
from matplotlib import style
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy import ndarray

from jointsdf.values import Unit
from jointsdf.viewing.isolines import STYLE, band_colours, draw_bands
from jointsdf.viewing.section import Section

SIZE = 8.0  # inches, of the picture's width and height
DPI = 120


def draw_section(
    section: Section, values: Float[ndarray, "n n"], levels: Float[ndarray, " k"], unit: Unit
) -> UInt8[ndarray, "h w 3"]:
    """Draw a section: orange inside, blue outside, a line at each level, the surface bold.

    Args:
        section: The plane and its square.
        values: On its raster, file units; NaN outside the training box.
        levels: Ascending, with 0 between the first and the last.
        unit: Of the file frame.
    """
    with style.context(["default", STYLE]):  # whatever the user's own settings are
        figure = Figure(figsize=(SIZE, SIZE), dpi=DPI, layout="constrained")
        panel = figure.add_subplot(title=f"{section.name} {unit.name}", aspect="equal")
        panel.set_xlabel(f"{section.axes[0]} ({unit.name})")
        panel.set_ylabel(f"{section.axes[1]} ({unit.name})")
        bands = band_colours(levels)
        draw_bands(panel, section, values, levels, bands)
        scale = figure.colorbar(bands, ax=panel, orientation="horizontal", shrink=0.8, aspect=40)
        scale.set_label(f"signed distance, negative inside ({unit.name})")
        canvas: Any = FigureCanvasAgg(figure)
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[..., :3].copy()
