"""Width of each part of a labelled mesh, which a grid has to resolve for the part to be found."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from jointsdf.geometry.face_graph import face_graph
from jointsdf.geometry.mesh import part_areas
from jointsdf.values import UNLABELLED, LabelledMesh


def part_widths(mesh: LabelledMesh) -> Float[ndarray, " k"]:
    """Hydraulic diameter of each part: four times its area by the length of its border with other parts.

    That is the side of a square, the diameter of a disc, and twice the width of a long strip. It is at most the side of
    a square of the part's area, which is the width of a part without border, such as a piece of its own.

    Args:
        mesh: Any frame, no degenerate face. Unlabelled faces are no part and make no border.

    Returns:
        Widths in mesh units, in the order of `mesh.part_ids`.
    """
    labelled = mesh.labels != UNLABELLED
    part = np.searchsorted(mesh.part_ids, mesh.labels)
    areas, graph = part_areas(mesh), face_graph(mesh)
    between = labelled[graph.pairs].all(axis=1) & (part[graph.pairs[:, 0]] != part[graph.pairs[:, 1]])
    sides = part[graph.pairs[between]].ravel()
    border = np.bincount(sides, np.repeat(graph.lengths[between], 2), len(mesh.part_ids))
    widths: Float[ndarray, " k"] = np.sqrt(areas)
    bordered = border > 0
    widths[bordered] = np.minimum(widths[bordered], 4 * areas[bordered] / border[bordered])
    return widths
