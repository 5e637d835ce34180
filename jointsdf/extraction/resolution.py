"""The grid that a field's own surface needs, where the ground truth's thinnest wall alone does not tell."""

import logging
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from jointsdf.extraction.extractor import Extraction, Surface
from jointsdf.extraction.sparse_grid import Sdf
from jointsdf.geometry.mesh import face_normals, ray_hits
from jointsdf.metrics.topology import topology
from jointsdf.shapes.mesh_report import LADDER
from jointsdf.values import BOX, LabelledMesh

log = logging.getLogger(__name__)

MOST = (
    30_000_000  # points that a finer sparse grid may take at the same share, two minutes of two cores: beyond is noise
)
FEWEST = 8  # faces that look at another from nearer than a cell, below which it is slivers of marching cubes by chance
FACING = -0.5  # cosine between the normals of two faces that look at each other: below it
LIFT = 4e-6  # of a ray's start off its face, network length units


def settled(extraction: Extraction, sdf: Sdf, ladder: Sequence[int] = LADDER) -> tuple[Extraction, Surface]:
    """The first grid from the given one up whose surface has no piece, hole or handle that the next finer one has not.

    A grid can open a wall or bridge a gap that is thinner than about one of its cells, so a surface without any such
    place is taken as it is. Others are compared with the next finer grid's, until the numbers of pieces and handles
    stay. Where the finest grid has such places too, or the next takes too long, that is said and the surface taken.

    Args:
        extraction: The coarsest grid to take.
        sdf: float32 points of the network frame -> signed distance, negative inside.
        ladder: Resolutions, ascending.

    Returns:
        What was settled on, and its surface.
    """
    surface = extraction.surface(sdf)
    finer = [resolution for resolution in ladder if resolution > extraction.resolution]
    while (close := close_faces(surface, extraction.resolution)) >= FEWEST:
        thin = f"{extraction.resolution}^3: {close} of {len(surface.faces)} faces are within a cell of another one"
        if not finer or (extraction.method == "sparse" and surface.evaluated * finer[0] ** 3 > MOST):
            reason = f"{finer[0]}^3 would take too long" if finer else "no finer grid is left"
            log.warning("%s: walls may be broken and gaps bridged there; %s", thin, reason)
            break
        other = replace(extraction, resolution=finer.pop(0))
        log.info("%s: compared with %d^3", thin, other.resolution)
        compared = other.surface(sdf)
        if pieces_and_handles(surface) == pieces_and_handles(compared):
            break
        extraction, surface = other, compared
    return extraction, surface


def close_faces(surface: Surface, resolution: int) -> int:
    """How many faces look at another, through a wall or across a gap, from nearer than a cell of the grid."""
    normals = face_normals(surface.vertices, surface.faces)
    corners = surface.vertices[surface.faces]
    centres, cell = corners.mean(axis=1), 2 * BOX / (resolution - 1)
    close = np.zeros(len(corners), dtype=bool)
    if not len(corners):
        return 0
    for directions in (-normals, normals):
        lengths, met = ray_hits(corners, centres + LIFT * directions, directions)
        close |= (met >= 0) & (lengths < cell) & ((normals * normals[met]).sum(axis=1) < FACING)
    return int(close.sum())


def pieces_and_handles(surface: Surface) -> tuple[float, float]:
    """Components and Euler number."""
    found = topology(LabelledMesh(surface.vertices, surface.faces, np.zeros(len(surface.faces), dtype=np.int64)))
    return found["components"], found["euler"]
