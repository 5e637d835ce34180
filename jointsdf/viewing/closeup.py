"""Close-up of edges, fitted and true: `python -m jointsdf.viewing.closeup RUN_FOLDER closeup.png`."""

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.extraction.extractor import Extraction
from jointsdf.extraction.resolution import cell_size
from jointsdf.geometry.creases import REACH, find_creases
from jointsdf.geometry.mesh import half_longest_side
from jointsdf.model.field import JointField
from jointsdf.runs.folder import FIELD, grid_of, read_result
from jointsdf.shapes.stored import stored_mesh_truth
from jointsdf.threads import large_pieces
from jointsdf.values import LabelledMesh, Shape
from jointsdf.viewing.raycast import Camera
from jointsdf.viewing.render import notice, write_png
from jointsdf.viewing.run_picture import run_picture
from jointsdf.viewing.triangles import draw_triangles
from jointsdf.viewing.viewpoint import best_axes, crowded_place

CELLS = 20  # of the grid, across a picture
WIDTH, HEIGHT, CAPTION, GAP = 400, 330, 24, 8  # pixels: of a picture, below it, between two
COLOURS = 64  # of the file, a third of the bytes of all colours
CORE = 0.3  # radius of the place that is looked for, in widths of a picture


def close_up(
    shape: Shape, meshes: dict[str, LabelledMesh], wide: float, place: Float[ndarray, "3"] | None = None
) -> UInt8[ndarray, "h w 3"]:
    """Draw the same place of several meshes side by side, seen by the same camera.

    Args:
        shape: Ground truth, whose creases decide what is looked at and from where.
        meshes: By their captions, file frame.
        wide: Width of what a picture shows, file units.
        place: Looked at, file frame; None for where the most creases are.

    Raises:
        InputError: No place is given, and the ground truth has no crease.
    """
    creases = find_creases(shape.mesh, 2 * REACH * half_longest_side(shape.mesh))
    if place is None:
        if len(creases.starts) == 0:
            raise InputError(f"{shape.name} has no crease to look at; give a place, e.g. --at 12.5,0,3")
        place = crowded_place(creases, CORE * wide)
    axes = best_axes(shape.mesh, creases, place, CORE * wide, shape.up)
    camera = Camera(axes, place, wide / WIDTH, WIDTH, HEIGHT)
    columns = []
    for caption, mesh in meshes.items():
        picture = np.concatenate([draw_triangles(mesh, camera), notice(caption, WIDTH, CAPTION)])
        columns += [np.full((HEIGHT + CAPTION, GAP, 3), 255, dtype=np.uint8), picture]
    return np.concatenate(columns[1:], axis=1)


def both_ways(field: JointField, extraction: Extraction) -> tuple[LabelledMesh, LabelledMesh]:
    """A field's mesh by marching cubes alone, and with sharp creases; file frame."""
    surface = extraction.surface(field.network_sdf)
    plain, sharp = (
        replace(extraction, sharp=sharp).label_faces(
            surface, field.network_part, field.normalisation, field.network_differential
        )
        for sharp in (False, True)
    )
    return plain, sharp


def parse_place(text: str) -> Float[ndarray, "3"]:
    """Make the point of three coordinates, e.g. `12.5,0,3`.

    Raises:
        InputError: Not three finite numbers.
    """
    try:
        place = np.array([float(number) for number in text.split(",")])
    except ValueError:
        place = np.zeros(0)
    if place.shape != (3,) or not np.isfinite(place).all():
        raise InputError(f"--at {text}: give x, y and z in file units, e.g. --at 12.5,0,3")
    return place


@large_pieces()
def write_close_up(folder: Path, picture: Path, at: str | None = None, trust: Sequence[str] = ()) -> None:
    """Extract a finished run's field both ways, on the run's grid, and draw a close-up.

    Args:
        folder: The run folder.
        picture: PNG to write.
        at: Place, see `parse_place`; None for where the most creases are.
        trust: Modules whose classes the folder's config may name.

    Raises:
        InputError: No finished run, its ground truth is no longer there, or an odd place.
    """
    place = None if at is None else parse_place(at)
    _, shape = stored_mesh_truth(folder, trust)
    resolution = grid_of(folder, read_result(folder))
    field = JointField.load(folder / FIELD)
    plain, sharp = both_ways(field, Extraction(resolution=resolution, borders="split"))
    wide = CELLS * cell_size(resolution) * field.normalisation.scale
    captions = (
        f"marching cubes, {resolution}^3",
        "extraction=sharp",
        f"ground truth, {wide:.3g} {shape.unit.name} across",
    )
    write_png(
        picture, close_up(shape, dict(zip(captions, (plain, sharp, shape.mesh), strict=True)), wide, place), COLOURS
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw a close-up of a finished run's edges.

    Returns:
        The exit code, 2 for an error that the user can correct.
    """
    description = "Draw a close-up of a finished run's edges: by marching cubes, sharp, and of the ground truth."
    at = ("X,Y,Z", "in file units; otherwise where the most creases are")
    return run_picture(arguments, write_close_up, name="closeup", description=description, at=at)


if __name__ == "__main__":
    sys.exit(main())
