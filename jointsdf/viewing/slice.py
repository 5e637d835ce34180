"""Slice of a fitted field beside the exact distance: `python -m jointsdf.viewing.slice RUN_FOLDER slice.png`."""

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import UInt8
from numpy import ndarray

from jointsdf.geometry.distance import network_distance
from jointsdf.geometry.mesh import half_longest_side
from jointsdf.model.field import JointField
from jointsdf.runs.folder import FIELD
from jointsdf.shapes.stored import stored_mesh_truth
from jointsdf.threads import large_pieces
from jointsdf.values import Shape
from jointsdf.viewing.isolines import WIDTH, draw_slice
from jointsdf.viewing.plane import Plane, Slice, choose_plane, parse_plane
from jointsdf.viewing.render import write_png
from jointsdf.viewing.run_picture import run_picture

RASTER = 150  # points along each side of the square


def slice_field(shape: Shape, field: JointField, plane: Plane, raster: int = RASTER) -> Slice:
    """Evaluate a field and the exact distance of its shape in a plane.

    Args:
        shape: Ground truth.
        field: Its fitted field.
        plane: Within the training box.
        raster: Points along each side of the square.
    """
    frame, points, square = field.normalisation, plane.raster(raster), (raster, raster)
    truth = network_distance(shape, frame).signed(frame.forward(points)) * frame.scale
    fit = field.query(points, what="sdf").sdf.astype(np.float64)
    return Slice(plane, truth.reshape(square), fit.reshape(square), 2 * half_longest_side(shape.mesh), shape.unit)


def render_slice(
    shape: Shape, field: JointField, *, caption: str, width: int = WIDTH, raster: int = RASTER
) -> UInt8[ndarray, "h w 3"]:
    """Draw ground truth, field and error in the plane that `choose_plane` chooses.

    Args:
        shape: Ground truth.
        field: Its fitted field.
        caption: Above the field.
        width: Pixels.
        raster: Points along each side of the square.
    """
    plane = choose_plane(shape.mesh, field.normalisation, shape.up)
    return draw_slice(slice_field(shape, field, plane, raster), caption=caption, width=width)


@large_pieces()
def write_slice(folder: Path, picture: Path, at: str | None = None, trust: Sequence[str] = ()) -> None:
    """Draw the slice of a finished run.

    Args:
        folder: The run folder.
        picture: PNG to write.
        at: Equation of the plane, see `parse_plane`; None for that of `choose_plane`.
        trust: Modules whose classes the folder's config may name.

    Raises:
        InputError: No finished run, its ground truth is no longer there, or an odd equation.
    """
    settings, shape = stored_mesh_truth(folder, trust)
    field = JointField.load(folder / FIELD)
    frame = field.normalisation
    plane = parse_plane(at, frame, shape.up) if at else choose_plane(shape.mesh, frame, shape.up)
    caption = f"{settings['recipe']}, head {settings['head']['name']}"
    write_png(picture, draw_slice(slice_field(shape, field, plane), caption=caption))


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw a slice of a finished run's field, beside the exact distance and with its error.

    Returns:
        The exit code, 2 for an error that the user can correct.
    """
    description = "Draw a slice of a finished run: the field beside the exact distance, and its error."
    at = ("PLANE", "e.g. y=12.5, in file units; otherwise the longest outline's")
    return run_picture(arguments, write_slice, name="slice", description=description, at=at)


if __name__ == "__main__":
    sys.exit(main())
