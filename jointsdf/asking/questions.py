"""The questions themselves: a field and the name of a file in, files and lines of text out."""

import logging
from collections.abc import Collection
from pathlib import Path

import numpy as np
import pandas as pd

from jointsdf.asking.answer_files import open_answers
from jointsdf.asking.answers import answer, flat_names, table_type
from jointsdf.asking.asked_run import AskedRun
from jointsdf.asking.point_files import read_pieces
from jointsdf.errors import InputError, require_integer, require_number
from jointsdf.extraction.offset import offset_mesh
from jointsdf.extraction.part_solids import CELLS, field_part_solids
from jointsdf.phases import phase, tell
from jointsdf.runs.files import write_atomically
from jointsdf.values import BOX, LabelledMesh
from jointsdf.viewing.isolines import isoline_levels, isoline_step
from jointsdf.viewing.part_folder import open_parts, write_parts
from jointsdf.viewing.render import write_png
from jointsdf.viewing.section import isolines, parse_section, section_values
from jointsdf.viewing.section_picture import draw_section

MOST_LEVELS = 500  # isolines of a slice

log = logging.getLogger(__name__)


def query_file(run: AskedRun, points: Path, out: Path, what: Collection[str]) -> None:
    """Ask the field at the points of a file, piece by piece, and write a row for each.

    Args:
        run: The field.
        points: File of points, file frame.
        out: csv, npy, npz or ply; there only when it is whole.
        what: Some of `answers.WHAT`.

    Raises:
        InputError: A file or a name cannot be used.
    """
    field, kind = run.field, table_type(run.field, what)
    count = outside = lost = 0
    with phase("query", f"{points}: {', '.join(what)}"), open_answers(out, kind, flat_names(field, kind)) as rows:
        for piece in read_pieces(points):
            table = answer(field, piece.points, kind)
            rows.write(table)
            count += len(table)
            outside += int((np.abs(field.normalisation.forward(piece.points)) > BOX).any(axis=1).sum())
            lost += int(np.isnan(table["distance"]).sum()) if "closest" in what else 0
            tell(count, round(count / piece.share))
    log.info("%s: %d points, unit %s", out, count, run.unit.name)
    if outside:
        log.warning("%d points lie outside the training box: distances are bounds, parts -1, curvatures nan", outside)
    if lost:
        log.warning("from %d points no surface was reached: nan", lost)


def slice_plane(run: AskedRun, plane: str, out: Path, *, step: float | None = None, raster: int = 400) -> None:
    """Draw the field in a plane, and write its isolines beside the picture as csv: level, line, closed, x, y, z.

    Args:
        run: The field.
        plane: `z=12.5`, or `nx,ny,nz,d`; file units.
        out: The picture, png.
        step: Between isolines, file units; None for a round one.
        raster: Points along each side of the square.

    Raises:
        InputError: No such plane, or a value out of range.
    """
    if out.suffix.lower() != ".png":
        raise InputError(f"--out {out}: give a name that ends in png; the isolines are written beside it as csv")
    require_integer("--raster", raster, 8, 4096)
    section = parse_section(plane, run.field.normalisation, run.up)
    with phase("slice", section.name):
        values = section_values(run.field, section, raster)
        known = values[np.isfinite(values)]
        chosen = isoline_step(known) if step is None else step
        require_number("--step", chosen, np.ptp(known) / MOST_LEVELS)
        levels = isoline_levels(known, chosen)
        lines = list(isolines(section, values, levels))
        write_png(out, draw_section(section, values, levels, run.unit))
        columns = {
            "level": np.repeat([line.level for line in lines], [len(line.points) for line in lines]),
            "line": np.repeat(np.arange(len(lines)), [len(line.points) for line in lines]),
            "closed": np.repeat([int(line.is_closed) for line in lines], [len(line.points) for line in lines]),
        }
        places = np.concatenate([line.points for line in lines]) if lines else np.zeros((0, 3))
        table = pd.DataFrame({**columns, **dict(zip("xyz", places.T, strict=True))})
        write_atomically(out.with_suffix(".csv"), table.to_csv(index=False, lineterminator="\n"))
    log.info("%s, %s: %d isolines every %g %s", out, out.with_suffix(".csv"), len(lines), chosen, run.unit.name)


def offset_surface(
    run: AskedRun, distance: float, out: Path, *, resolution: int | None = None, sharp: bool = False
) -> None:
    """Write the mesh of a level set.

    Args:
        run: The field.
        distance: File units, negative inside.
        out: ply, stl, obj, glb or off.
        resolution: Grid points along each axis; None for the run's.
        sharp: Whether creases are made sharp.

    Raises:
        InputError: There is no such surface in the training box, or another ending.
    """
    with phase("offset", f"{distance:g} {run.unit.name}"):
        mesh = offset_mesh(run.field, distance, run.extraction(resolution, sharp=sharp))
        run.as_part_mesh(mesh).export(out)
    log.info("%s: %d faces, %d parts", out, len(mesh.faces), len(mesh.part_ids))


def parts_of(run: AskedRun, folder: Path, suffix: str, *, solid: bool, cells: int = CELLS) -> dict[int, LabelledMesh]:
    """Write a mesh of each part: its surface as it is, open, or a closed solid.

    Args:
        run: The field.
        folder: Of the files `part_<id>.<suffix>`.
        suffix: ply or stl.
        solid: Whether to write solids.
        cells: Of the grid that solids are cut on, along the longest side.

    Returns:
        What was written, by part id.

    Raises:
        InputError: The surface has no parts, or is not closed.
    """
    with phase("parts", "closed solids" if solid else "surfaces"):
        mesh = run.mesh()
        parts = field_part_solids(run.field, mesh, cells) if solid else open_parts(mesh)
        write_parts(folder, parts, suffix, run.unit, run.up)
    return parts
