"""A solid cut into one closed solid per part, by booleans of manifold3d (Lalish, github.com/elalish/manifold)."""

import logging

import numpy as np
from jaxtyping import Float, Int
from manifold3d import Error, Manifold, Mesh64, OpType
from numpy import ndarray

from jointsdf.errors import InputError, require_integer
from jointsdf.extraction.part_cells import Sdf, cutters
from jointsdf.geometry.mesh import part_areas
from jointsdf.model.field import JointField
from jointsdf.values import UNLABELLED, LabelledMesh

CELLS = 96  # of the grid, along the longest side of the solid
ROUNDING = 1e-9  # of volumes, relative

log = logging.getLogger(__name__)


def part_solids(mesh: LabelledMesh, sdf: Sdf, cells: int = CELLS) -> dict[int, LabelledMesh]:
    """Cut a solid into the cells of its parts: each inner point belongs to the part whose surface is nearest.

    One part after another is cut out of what is left, from the smallest surface to the largest, so that the volumes add
    up to the solid's, and neighbours have their common walls in common. Along a border on the surface a wall is within
    a cell of the grid. A component smaller than a cell is a scrap of that: it goes to the other side of the cut.

    Args:
        mesh: Closed surface of the solid with a part per face, file frame.
        sdf: Signed distance of the solid, negative inside, file frame.
        cells: Of the grid, along the longest side.

    Returns:
        A closed mesh of each part, faces outward, all of its faces labelled by the part; ascending by part id.

    Raises:
        InputError: Faces without part, a mesh that is not closed, or a grid out of range.
    """
    require_integer("cells", cells, 8, 512)
    if mesh.is_empty or (mesh.labels == UNLABELLED).any():
        raise InputError("solids of parts: the surface has no parts (head=none) or is empty; fit with a head")
    middle = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2  # booleans about it keep their digits
    centred = LabelledMesh(mesh.vertices - middle, mesh.faces, mesh.labels)
    side = float(np.ptp(mesh.vertices, axis=0).max()) / cells
    order = mesh.part_ids[np.argsort(part_areas(mesh), kind="stable")]
    rest, found = _solid(centred.vertices, centred.faces), {}
    for cutter in cutters(centred, lambda points: sdf(points + middle), order, side):
        piece, rest = rest.split(_solid(cutter.vertices, cutter.faces))
        piece, rest = _hand_over_scraps(piece, rest, side**3)
        rest, found[cutter.part] = _hand_over_scraps(rest, piece, side**3)
    found[int(order[-1])] = rest
    return {part: _mesh(found[part], part, middle) for part in sorted(found)}


def field_part_solids(field: JointField, mesh: LabelledMesh, cells: int = CELLS) -> dict[int, LabelledMesh]:
    """`part_solids` of a field, by its own distance.

    Args:
        field: The fitted field.
        mesh: Its mesh, file frame.
        cells: Of the grid, along the longest side.
    """

    def sdf(points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        return field.network_sdf(field.normalisation.forward(points)) * float(field.scale)

    return part_solids(mesh, sdf, cells)


def _hand_over_scraps(giver: Manifold, taker: Manifold, least: float) -> tuple[Manifold, Manifold]:
    """Components of one side of a cut below a volume go to the other side; the largest stays, and so do cavities, which
    count as components of negative volume, with what is around them.
    """  # noqa: D205
    components = sorted(giver.decompose(), key=Manifold.volume, reverse=True)
    scraps = [each for each in components[1:] if 0 <= each.volume() < least]
    if not scraps:
        return giver, taker
    kept = Manifold.compose([each for each in components if each not in scraps])
    taken = Manifold.batch_boolean([taker, *scraps], OpType.Add)
    whole = giver.volume() + taker.volume()
    if abs(kept.volume() + taken.volume() - whole) > ROUNDING * whole:  # a scrap with a cavity
        return giver, taker
    log.info("scraps smaller than a cell of the grid go to a neighbouring part: %d", len(scraps))
    return kept, taken


def _solid(vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]) -> Manifold:
    solid = Manifold(Mesh64(np.ascontiguousarray(vertices, dtype=np.float64), faces.astype(np.uint64)))
    if solid.status() != Error.NoError:
        raise InputError(f"solids of parts: a surface is not closed ({solid.status().name}); give another resolution")
    return solid


def _mesh(solid: Manifold, part: int, middle: Float[ndarray, "3"]) -> LabelledMesh:
    arrays = solid.to_mesh64()
    vertices = np.asarray(arrays.vert_properties, dtype=np.float64)[:, :3] + middle
    faces = np.asarray(arrays.tri_verts).astype(np.int64)
    return LabelledMesh(vertices, faces, np.full(len(faces), part))
