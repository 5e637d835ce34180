"""Labels of triangles from one number per triangle, polygon, vertex or B-rep face, told apart by their count."""

import logging
from collections.abc import Callable

from jaxtyping import Int
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.shapes.readers.face_columns import majority
from jointsdf.shapes.readers.file_mesh import FileMesh

Reading = tuple[str, int, Callable[[Int[ndarray, " n"]], Int[ndarray, " f"]]]

logger = logging.getLogger(__name__)


def spread_labels(
    source: str,
    labels: Int[ndarray, " n"],
    mesh: FileMesh,
    patches: Int[ndarray, " f"] | None = None,
    *,
    patches_first: bool = False,
) -> Int[ndarray, " f"]:
    """Spread labels over the triangles of a mesh file; of several readings of their count the first, with a warning.

    Args:
        source: Names the labels in messages.
        labels: One per triangle, per polygon of the file, per vertex (the majority of a triangle's corners; of three
            different ones the first), or per B-rep face.
        mesh: The mesh file.
        patches: B-rep face of each triangle of a STEP file, else None.
        patches_first: Whether B-rep faces come before all others.

    Raises:
        InputError: There is another number of labels.
    """
    readings = _list_readings(mesh, patches)
    if patches_first:
        readings.sort(key=lambda reading: reading[0] != "B-rep faces")
    fitting = [reading for reading in readings if reading[1] == len(labels)]
    if not fitting:
        counts = ", ".join(f"{count} {name}" for name, count, _ in readings)
        raise InputError(
            f"{source} has {len(labels)} labels, the mesh has {counts}: give one label for each of one kind"
        )
    if len(fitting) > 1:
        names = " and ".join(name for name, _, _ in fitting)
        logger.warning("%s: its %d labels fit %s: read as of %s", source, len(labels), names, fitting[0][0])
    return fitting[0][2](labels)


def _list_readings(mesh: FileMesh, patches: Int[ndarray, " f"] | None) -> list[Reading]:
    """Name, count and spreading of each kind of thing that can be labelled."""
    plain = mesh.polygons is None and patches is None
    readings: list[Reading] = [("faces" if plain else "triangles", len(mesh.faces), lambda labels: labels)]
    if mesh.polygons is not None:
        polygons = mesh.polygons
        readings.append(("polygons", int(polygons.max()) + 1, lambda labels: labels[polygons]))
    readings.append(("vertices", len(mesh.vertices), lambda labels: majority(labels, mesh.faces)))
    if patches is not None:
        readings.append(("B-rep faces", int(patches.max()) + 1, lambda labels: labels[patches]))
    return readings
