"""Commands that put questions to a finished run (Click): query, slice, offset, measure, parts. Import no torch."""

import functools
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from jointsdf.cli_logging import configure_logging, user_errors
from jointsdf.errors import InputError
from jointsdf.user_paths import expand_home

NUMBERS = {"ignore_unknown_options": True}  # -0.8 is a distance
STOPPED = "stopped; nothing is written"

run_argument = click.argument("run")


class UserPath(click.ParamType):  # type: ignore[type-arg]
    """A path as a user types it, with `~`."""

    name = "file"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:  # noqa: ARG002
        """The path."""
        return Path(expand_home(str(value)))


PATH = UserPath()


def reported(question: Callable[..., None]) -> Callable[..., None]:
    """Log errors of a command that the user can correct as one line, and exit with code 2 after one."""

    @functools.wraps(question)
    def run(**options: Any) -> None:
        configure_logging()
        failed: list[str] = []
        with user_errors(failed, stopped=STOPPED):
            try:
                question(**options)
            except OSError as error:
                where = f"{error.filename}: " if error.filename else ""
                fix = "give a file in a folder that can be written and has room"
                raise InputError(f"{where}{error.strerror or error}; {fix}") from error
        sys.exit(2 if failed else 0)

    return run


@click.command(short_help="Distance, part, ... of a run at the points of a file.")
@run_argument
@click.argument("points", type=PATH)
@click.option("--out", type=PATH, required=True, help="csv, npy, npz or ply; there only when it is whole.")
@click.option(
    "--what",
    default="sdf,part,gradient",
    show_default=True,
    help="Of sdf,part,probabilities,gradient,closest,curvatures.",
)
@reported
def query(run: str, points: Path, out: Path, what: str) -> None:
    """Ask the field of RUN, a run folder or a field.ckpt, at the points of a file.

    POINTS is csv, xyz, npy, ply or another file of points, in the units of the shape's file. The answers are in these
    units: signed distance, part id, probability of each part, gradient, closest point of the surface with its distance,
    both principal curvatures (positive on a ball).
    """
    from jointsdf.asking.answers import parse_what
    from jointsdf.asking.asked_run import open_run
    from jointsdf.asking.questions import query_file

    names = parse_what(what)
    query_file(open_run(run), points, out, names)


@click.command("slice", short_help="Picture and isolines of a run in a plane.")
@run_argument
@click.option("--plane", required=True, help="z=12.5, or nx,ny,nz,d for nx x + ny y + nz z = d, in file units.")
@click.option("--out", type=PATH, default="slice.png", show_default=True, help="Picture; isolines beside it as csv.")
@click.option("--step", type=float, help="Between isolines, file units; a round one by default.")
@click.option("--raster", type=int, default=400, show_default=True, help="Points along each side of the picture.")
@reported
def slice_command(run: str, plane: str, out: Path, step: float | None, raster: int) -> None:
    """Draw the field of RUN in a plane, with its isolines as polylines.

    The csv has a row for each corner: level, number of the line, whether it is closed, x, y, z, in file units.
    """
    from jointsdf.asking.asked_run import open_run
    from jointsdf.asking.questions import slice_plane

    slice_plane(open_run(run), plane, out, step=step, raster=raster)


@click.command(context_settings=NUMBERS, short_help="Surface at a distance from that of a run.")
@run_argument
@click.argument("distance", type=float)
@click.option("--out", type=PATH, required=True, help="ply, stl, obj, glb or off.")
@click.option("--resolution", type=int, help="Grid points along each axis; the run's by default.")
@click.option("--sharp", is_flag=True, help="Make creases sharp.")
@reported
def offset(run: str, distance: float, out: Path, resolution: int | None, sharp: bool) -> None:
    """Write the surface at DISTANCE (file units, negative inside) from that of RUN, with its parts."""
    from jointsdf.asking.asked_run import open_run
    from jointsdf.asking.questions import offset_surface

    offset_surface(open_run(run), distance, out, resolution=resolution, sharp=sharp)


@click.command(short_help="Volume, area, centre of mass, inertia of a run, and its parts.")
@run_argument
@click.option("--out", type=PATH, help="json or csv.")
@click.option("--resolution", type=int, default=256, show_default=True, help="Cells along each side of the box.")
@reported
def measure(run: str, out: Path | None, resolution: int) -> None:
    """Volume, area, centre of mass and inertia of RUN, and area and centroid of each part.

    Twice: by integrals of the field, and by its mesh. Density 1; inertia about the centre of mass.
    """
    from jointsdf.asking.asked_run import open_run
    from jointsdf.asking.measuring import measure_rows, measure_run, write_measures

    asked = open_run(run)
    found = measure_run(asked, resolution=resolution)
    rows: dict[tuple[str, str], dict[str, str]] = {}
    for quantity, unit, source, numbers in measure_rows(found, asked.unit.name):
        text = "  ".join(f"{number:.6g}" for number in numbers)
        rows.setdefault((quantity, unit), {})[source] = text
    click.echo(f"{'':<18} {'':<6} {'field':<36} mesh")
    for (quantity, unit), texts in rows.items():
        click.echo(f"{quantity:<18} {unit:<6} {texts.get('field', '-'):<36} {texts.get('mesh', '-')}")
    if out is not None:
        write_measures(found, asked.unit.name, out)


@click.command(short_help="A file for each part of a run, as a surface or a closed solid.")
@run_argument
@click.option("--solid", is_flag=True, help="Closed solids, whose volumes add up to the whole; else open surfaces.")
@click.option("--format", "suffix", type=click.Choice(["ply", "stl"]), default="ply", show_default=True)
@click.option("--cells", type=int, default=96, show_default=True, help="Of the grid that solids are cut on.")
@click.option("--out", type=PATH, help="Folder; parts/ in the run folder by default.")
@reported
def parts(run: str, solid: bool, suffix: str, cells: int, out: Path | None) -> None:
    """Write part_<id>.ply or .stl for each part of RUN.

    A solid is what is nearer to the part's surface than to that of any other part.
    """
    from jointsdf.asking.asked_run import open_run
    from jointsdf.asking.questions import parts_of
    from jointsdf.geometry.topology import signed_volume

    asked = open_run(run)
    if out is None and asked.folder is None:
        raise InputError("--out is missing: a field file alone has no run folder; give a folder")
    folder = out or asked.folder / "parts"  # type: ignore[operator]
    for part, mesh in parts_of(asked, folder, suffix, solid=solid, cells=cells).items():
        volume = f", volume {signed_volume(mesh.vertices, mesh.faces):.6g} {asked.unit.name}^3" if solid else ""
        click.echo(f"{folder / f'part_{part}.{suffix}'}: {len(mesh.faces)} faces{volume}")


COMMANDS = (query, slice_command, offset, measure, parts)
