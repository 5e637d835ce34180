"""Page of pictures: rows with titles, notes and colour scales."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from jaxtyping import UInt8
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy import ndarray

from jointsdf.study.figures.style import STYLE, WIDTH

HEAT = "YlOrRd"
TRIM_MARGIN = 8  # pixels

Picture = UInt8[ndarray, "h w 3"]


@dataclass(frozen=True)
class Row:
    """One row of pictures.

    Attributes:
        title: At its left.
        pictures: All of one size.
        notes: Below each picture.
        heat: End of the colour scale in percent of the longest side; None for no scale.
    """

    title: str
    pictures: list[Picture]
    notes: list[str]
    heat: float | None = None


def trim(pictures: Sequence[Picture]) -> list[Picture]:
    """Crop the rows of pixels that are white in all pictures, up to a margin."""
    rows = np.flatnonzero((np.concatenate(pictures, axis=1) < 255).any(axis=(1, 2)))
    if not len(rows):
        return list(pictures)
    low, high = max(rows[0] - TRIM_MARGIN, 0), rows[-1] + TRIM_MARGIN
    return [picture[low:high] for picture in pictures]


def draw_page(rows: Sequence[Row], titles: Sequence[str]) -> Figure:
    """Draw the rows below each other, pictures in columns under their titles."""
    left, gap, head, note = 0.85, 0.06, 0.25, 0.24
    scale = 0.56 if any(row.heat for row in rows) else 0.0
    side = (WIDTH - left - scale) / len(titles) - gap
    heights = [side * row.pictures[0].shape[0] / row.pictures[0].shape[1] for row in rows]
    total = head + sum(max(height, 0.75) + note for height in heights)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH, total))
        top = total - head
        for number, (row, height) in enumerate(zip(rows, heights, strict=True)):
            room = max(height, 0.75)
            middle = top - room / 2
            figure.text(0.02 / WIDTH, middle / total, row.title.replace(": ", ":\n"), va="center", fontsize=7)
            for place, (picture, text) in enumerate(zip(row.pictures, row.notes, strict=True)):
                x = left + place * (side + gap)
                ax = figure.add_axes((x / WIDTH, (middle - height / 2) / total, side / WIDTH, height / total))
                _show(ax, picture)
                figure.text((x + side / 2) / WIDTH, (top - room - 0.12) / total, text, ha="center", fontsize=6.5)
                if number == 0:
                    figure.text((x + side / 2) / WIDTH, (total - 0.15) / total, titles[place], ha="center", fontsize=8)
            if row.heat:
                box = ((WIDTH - scale + 0.08) / WIDTH, (middle - 0.36) / total, 0.07 / WIDTH, 0.72 / total)
                _scale(figure, box, row.heat)
            top -= room + note
    return figure


def _show(ax: Axes, picture: Picture) -> None:
    ax.imshow(picture, interpolation="lanczos")
    ax.set_axis_off()


def _scale(figure: Figure, box: tuple[float, float, float, float], end: float) -> None:
    bar: Any = figure.colorbar(ScalarMappable(Normalize(0, end), HEAT), cax=figure.add_axes(box))
    bar.set_ticks([0, end], labels=["0", f"{end:.2g}%"])
    bar.ax.tick_params(labelsize=6.5, length=2)
    bar.outline.set_linewidth(0.4)
