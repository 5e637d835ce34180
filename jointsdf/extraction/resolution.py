"""Choice of the extraction grid: two cells across walls and parts, then refined until the topology is stable."""

import logging
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from jointsdf.extraction.extractor import Extraction, Surface
from jointsdf.extraction.sparse_grid import Sdf, TooLarge
from jointsdf.geometry.mesh import face_normals
from jointsdf.geometry.rays import ray_hits
from jointsdf.geometry.topology import topology
from jointsdf.values import BOX, LabelledMesh

LADDER = (256, 384, 512, 768, 1024)  # resolutions to choose from
FINEST = LADDER[-1]
LISTED = 8  # parts in a warning
CELLS = 2  # needed across a wall or a part
MOST_POINTS = 30_000_000  # evaluated on the next grid, two minutes on two cores: a field that needs more is noise
NOISE = 128  # grid of a surface that fills the box: ten million faces at most
FEWEST_CLOSE = 8  # faces within a cell of another one: fewer are slivers of marching cubes
FACING = -0.5  # largest cosine between the normals of two faces that face each other
LIFT = 4e-6  # of a ray's origin off its face, network length units

log = logging.getLogger(__name__)


def cell_size(resolution: int) -> float:
    """Edge of a cell of the grid over the training box, network length units."""
    return 2 * BOX / (resolution - 1)


def resolution_for(wall: float, parts: Iterable[float] = ()) -> int:
    """Coarsest grid of the ladder with `CELLS` cells across a wall and the parts; the finest where none has them.

    Args:
        wall: Thickness, network length units.
        parts: Width of each part, network length units. Those that the finest grid cannot hold do not count.

    Returns:
        Points along each axis.

    >>> resolution_for(0.02), resolution_for(0.001)
    (256, 1024)
    """
    thinnest = min([wall, *(width for width in parts if width >= CELLS * cell_size(FINEST))])
    return next((resolution for resolution in LADDER if thinnest >= CELLS * cell_size(resolution)), FINEST)


def grid_warnings(wall: float, widths: Mapping[int, float], resolution: int, scale: float, unit: str) -> list[str]:
    """What a grid cannot hold, one line each; arguments as of `thin_wall_warning` and `narrow_parts_warning`."""
    warnings = thin_wall_warning(wall, resolution, scale, unit), narrow_parts_warning(widths, resolution, scale, unit)
    return [warning for warning in warnings if warning is not None]


def thin_wall_warning(wall: float, resolution: int, scale: float, unit: str) -> str | None:
    """One line where a wall is under `CELLS` cells of a grid, with the grid that holds it; None where it is not.

    Args:
        wall: Thickness, file units.
        resolution: Points along each axis of the grid.
        scale: File units per network unit.
        unit: Symbol of the file unit.
    """
    cell = cell_size(resolution) * scale
    if wall >= CELLS * cell:
        return None
    enough = math.ceil(CELLS * 2 * BOX * scale / wall) + 1
    fix = f"give extraction.resolution={enough}" if enough <= FINEST else f"no grid up to {FINEST} can hold it"
    return (
        f"its thinnest wall ({wall:.3g} {unit}) is under {CELLS} cells of the grid (of {cell:.3g} {unit}): "
        f"it will vanish or break; {fix}"
    )


def narrow_parts_warning(widths: Mapping[int, float], resolution: int, scale: float, unit: str) -> str | None:
    """One line on the parts narrower than a cell of a grid, with the grid that holds them; None where there is none.

    Args:
        widths: Of each part, file units, by its id.
        resolution: Points along each axis of the grid.
        scale: File units per network unit.
        unit: Symbol of the file unit.
    """
    cell = cell_size(resolution) * scale
    narrow = sorted((width, part) for part, width in widths.items() if width < cell)
    if not narrow:
        return None
    shown = ", ".join(f"{part} ({width:.3g} {unit})" for width, part in narrow[:LISTED])
    more = f" and {len(narrow) - LISTED} more" if len(narrow) > LISTED else ""
    enough = math.ceil(2 * BOX * scale / narrow[0][0]) + 1
    fix = f"give extraction.resolution={enough}" if enough <= FINEST else f"no grid up to {FINEST} can hold them all"
    return f"parts narrower than a cell of the grid ({cell:.3g} {unit}) may vanish: {shown}{more}; {fix}"


def refine_until_stable(extraction: Extraction, sdf: Sdf, ladder: Sequence[int] = LADDER) -> tuple[Extraction, Surface]:
    """Refine the grid until the number of components and the Euler characteristic stop changing.

    A grid can open a wall or bridge a gap thinner than about one of its cells, so a surface without such places is
    returned as it is. Others are compared with the next finer grid's. Where the finest grid has such places too, or
    the next takes too long, a warning is logged and the surface is returned. One that fills the box, as noise does, is
    extracted with `NOISE` points along each axis, so that it can be measured as well.

    Args:
        extraction: The coarsest grid.
        sdf: float32 points of the network frame -> signed distance, negative inside.
        ladder: Resolutions, ascending.

    Returns:
        The extraction with the resolution found, and its surface.
    """
    try:
        surface = extraction.surface(sdf)
    except TooLarge as error:
        log.warning("%s, which is taken: %d", error, NOISE)
        extraction = replace(extraction, resolution=NOISE)
        return extraction, extraction.surface(sdf)
    finer = [resolution for resolution in ladder if resolution > extraction.resolution]
    while (close := count_close_faces(surface, extraction.resolution)) >= FEWEST_CLOSE:
        thin = f"{extraction.resolution}^3: {close} of {len(surface.faces)} faces are within a cell of another one"
        if not finer or (extraction.method == "sparse" and surface.evaluated * finer[0] ** 3 > MOST_POINTS):
            reason = f"{finer[0]}^3 would take too long" if finer else "no finer grid is left"
            log.warning("%s: walls may be broken and gaps bridged there; %s", thin, reason)
            break
        other = replace(extraction, resolution=finer.pop(0))
        log.info("%s: compared with %d^3", thin, other.resolution)
        try:
            compared = other.surface(sdf)
        except TooLarge as error:
            log.warning("%s; that of %d^3 is taken", error, extraction.resolution)
            break
        if components_and_euler(surface) == components_and_euler(compared):
            break
        extraction, surface = other, compared
    return extraction, surface


def count_close_faces(surface: Surface, resolution: int) -> int:
    """Number of faces that face another, through a wall or across a gap, at less than a cell of the grid."""
    normals = face_normals(surface.vertices, surface.faces)
    corners = surface.vertices[surface.faces]
    centres, cell = corners.mean(axis=1), cell_size(resolution)
    close = np.zeros(len(corners), dtype=bool)
    if not len(corners):
        return 0
    for directions in (-normals, normals):
        lengths, met = ray_hits(corners, centres + LIFT * directions, directions)
        close |= (met >= 0) & (lengths < cell) & ((normals * normals[met]).sum(axis=1) < FACING)
    return int(close.sum())


def components_and_euler(surface: Surface) -> tuple[float, float]:
    """Number of connected components and Euler characteristic of a surface."""
    found = topology(LabelledMesh(surface.vertices, surface.faces, np.zeros(len(surface.faces), dtype=np.int64)))
    return found["components"], found["euler"]
