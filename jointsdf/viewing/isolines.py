"""Picture of a slice: bands and isolines of the signed distance, ground truth beside fit, and the error of the fit."""

from typing import Any

import numpy as np
from jaxtyping import Float, UInt8
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colorbar import Colorbar
from matplotlib.colors import BoundaryNorm, LinearSegmentedColormap, ListedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy import ndarray

from jointsdf.viewing.plane import AXES, Raster, Slice

INK = "#1c1e24"
# Orange inside, blue outside, which differ with any colour vision; the paler the nearer to the surface.
INSIDE = LinearSegmentedColormap.from_list("inside", ["#fbc98a", "#ee8a2f", "#a34a0b", "#5f2606"])
OUTSIDE = LinearSegmentedColormap.from_list("outside", ["#eef5fb", "#b4d3ea", "#6ba3d0", "#2b6aa8", "#123f73"])
MOST, FEWEST = 30, 16  # bands: at most, and the number from which the step is rounded up
DEEP = 4  # bands from the surface to the deepest point, where at most `MOST` in all make so many
PALE = 3  # bands inside, if there are fewer, have colours as of so many
TICKS = 12  # numbers at the scale of distances, at most
HEAT = "YlOrRd"  # colours of errors
ERRORS = (1e-5, 2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2, 1e-1)  # of the longest side
STYLE: Any = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 10,
    "axes.titlesize": 11,
    "axes.edgecolor": INK,
    "axes.linewidth": 0.8,
    "axes.labelcolor": INK,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
}
# Layout in hundredths of an inch, which are pixels at the usual width.
WIDTH, HEIGHT = 1280, 520
LEFT, BOTTOM, SIDE = (72, 464, 880), 112, 366  # of the panels
BAR_BOTTOM, BAR_HEIGHT = 44, 13  # of the scales


def draw_slice(found: Slice, *, caption: str = "fit", width: int = WIDTH) -> UInt8[ndarray, "h w 3"]:
    """Draw ground truth and fit with the same isolines and colours, and the error of the fit.

    Args:
        found: The distances.
        caption: Above the fit.
        width: Pixels.
    """
    with style.context(["default", STYLE]):  # whatever the user's own settings are
        figure = slice_figure(found, caption)
        figure.set_dpi(100 * width / WIDTH)
        canvas: Any = FigureCanvasAgg(figure)
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def slice_figure(found: Slice, caption: str) -> Figure:
    """Make the figure of `draw_slice`: three panels and two scales."""
    figure = Figure(figsize=(WIDTH / 100, HEIGHT / 100))
    unit, step = found.unit.name, isoline_step(found.truth)
    titles = (f"ground truth at {found.plane.name} {unit}", caption, "error")
    truth, fit, error = (_add_panel(figure, found, left, title) for left, title in zip(LEFT, titles, strict=True))
    levels = isoline_levels(found.truth, step)
    bands = band_colours(levels)
    for panel, values in ((truth, found.truth), (fit, found.fit)):
        draw_bands(panel, found.plane, values, levels, bands)
    scale = _add_scale(figure, bands, LEFT[0], LEFT[1] + SIDE)
    scale.set_label(f"signed distance, negative inside; isolines every {step:g} {unit}")
    every = next(count for count in (1, 2, 5, 10) if len(levels) <= count * TICKS)
    scale.set_ticks(levels[np.rint(levels / step) % every == 0])
    errors = np.clip(np.abs(found.fit - found.truth) / found.size, ERRORS[0], ERRORS[-1])
    places = found.plane.ticks(len(errors))
    heat = error.contourf(*places, errors, ERRORS, norm=BoundaryNorm(ERRORS, 256), cmap=HEAT)
    _draw_surface(error, found.plane, found.truth, 1.0)
    scale = _add_scale(figure, heat, LEFT[2], LEFT[2] + SIDE)
    scale.set_label("|fit - truth| as a share of the longest side")
    scale.set_ticks(ERRORS[::3], labels=[f"{100 * share:g}%" for share in ERRORS[::3]])
    return figure


def isoline_step(distances: Float[ndarray, "..."]) -> float:
    """Round step of isolines, 1, 2 or 5 times a power of ten, that makes about 7 to 30 bands.

    Args:
        distances: Signed, not all 0.

    >>> isoline_step(np.array([[-6.0, 45.0]]))
    2.0
    """
    low, high = min(float(distances.min()), 0.0), max(float(distances.max()), 0.0)
    wanted = max((high - low) / MOST, min((high - low) / FEWEST, -low / DEEP or np.inf))
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(power * next(digit for digit in (1, 2, 5, 10) if digit * power >= wanted))


def isoline_levels(distances: Float[ndarray, "..."], step: float) -> Float[ndarray, " k"]:
    """Multiples of the step that enclose all distances, and at least one on either side of 0.

    >>> isoline_levels(np.array([[-6.0, 14.0]]), 5.0).tolist()
    [-10.0, -5.0, 0.0, 5.0, 10.0, 15.0]
    """
    first, last = min(np.floor(distances.min() / step), -1), max(np.ceil(distances.max() / step), 1)
    levels: ndarray = np.arange(first, last + 1) * step
    return levels


def band_colours(levels: Float[ndarray, " k"]) -> ScalarMappable:
    """Colour between each two levels; those of the last bands beyond them."""
    inside, outside = int((levels < 0).sum()), int((levels > 0).sum())
    depth, height = np.arange(inside)[::-1] + 0.5, np.arange(outside) + 0.5
    colours = [*INSIDE(depth / max(inside, PALE)), *OUTSIDE(height / outside)]
    colormap = ListedColormap(colours).with_extremes(under=colours[0], over=colours[-1])
    return ScalarMappable(BoundaryNorm(levels, len(colours)), colormap)


def _add_panel(figure: Figure, found: Slice, left: int, title: str) -> Axes:
    """Add the axes of a panel, in file units."""
    panel = figure.add_axes((left / WIDTH, BOTTOM / HEIGHT, SIDE / WIDTH, SIDE / HEIGHT), title=title)
    panel.set_xlabel(f"{AXES[found.plane.right]} ({found.unit.name})")
    panel.tick_params(labelleft=left == LEFT[0])
    if left == LEFT[0]:
        panel.set_ylabel(f"{AXES[found.plane.up]} ({found.unit.name})")
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_major_locator(MaxNLocator(5))
    return panel


def _add_scale(figure: Figure, colours: ScalarMappable, left: int, right: int) -> Colorbar:
    """Add a colour scale below panels."""
    box = (left / WIDTH, BAR_BOTTOM / HEIGHT, (right - left) / WIDTH, BAR_HEIGHT / HEIGHT)
    return figure.colorbar(colours, cax=figure.add_axes(box), orientation="horizontal")


def draw_bands(
    panel: Axes, plane: Raster, values: Float[ndarray, "n n"], levels: Float[ndarray, " k"], bands: ScalarMappable
) -> None:
    """Fill the bands between levels, and draw isolines and the surface; NaN is left blank."""
    places, values = plane.ticks(len(values)), np.ma.masked_invalid(values)
    panel.contourf(*places, values, levels, cmap=bands.cmap, norm=bands.norm, extend="both")
    lines = levels[(levels > values.min()) & (levels < values.max()) & (levels != 0)]
    if len(lines):  # matplotlib warns of none
        panel.contour(*places, values, lines, colors=INK, linewidths=0.5, linestyles="solid", alpha=0.55)
    _draw_surface(panel, plane, values, 2.0)


def _draw_surface(panel: Axes, plane: Raster, values: Float[ndarray, "n n"], width: float) -> None:
    """Draw the isoline of 0, if there is one."""
    if values.min() < 0 < values.max():
        panel.contour(*plane.ticks(len(values)), values, [0.0], colors=INK, linewidths=width)
