"""Bodies of a tessellated STEP file: which faces are of one, and their vertices merged."""

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from jointsdf.shapes.readers.file_mesh import number_names


def weld(
    vertices: Float[ndarray, "v 3"],
    faces: Int[ndarray, "f 3"],
    patches: Int[ndarray, " f"],
    products: Int[ndarray, " f"],
) -> tuple[Float[ndarray, "w 3"], Int[ndarray, "g 3"], Int[ndarray, " g"], Bool[ndarray, " f"]]:
    """Merge the vertices of each body by position, and drop degenerate triangles.

    Bodies that touch stay apart, so that each is closed.

    Args:
        vertices: Positions, equal ones bit by bit.
        faces: Vertex indices.
        patches: The patch of each face, ascending from one body to the next.
        products: The product of each face, ascending; it holds whole bodies.

    Returns:
        Vertices, faces, the body of each face numbered from 0, and which of the given faces they are.
    """
    positions, index = np.unique(vertices, axis=0, return_inverse=True)
    merged = index.reshape(-1)[faces]
    proper = (merged != np.roll(merged, 1, axis=1)).all(axis=1)
    merged = merged[proper]
    bodies = number_names(_find_bodies(merged, patches[proper], products[proper]))
    corners = np.column_stack([np.repeat(bodies, 3), merged.ravel()])
    used, index = np.unique(corners, axis=0, return_inverse=True)
    return positions[used[:, 1]], index.reshape(-1, 3), bodies, proper


def _find_bodies(
    faces: Int[ndarray, "f 3"], patches: Int[ndarray, " f"], products: Int[ndarray, " f"]
) -> Int[ndarray, " f"]:
    """Find the body of each face: one ends at each patch that leaves no edge without its second face."""
    ends = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    owners, edge_products = np.repeat(patches, 3), np.repeat(products, 3)
    order = np.lexsort((owners, ends[:, 1], ends[:, 0], edge_products))
    ends, owners = np.column_stack([edge_products, ends])[order], owners[order]
    same = np.append((ends[1:] == ends[:-1]).all(axis=1), False)  # whether the next use is of the same edge
    places = np.arange(len(ends))
    starts = np.maximum.accumulate(np.where(np.append(True, ~same[:-1]), places, 0))
    opens = np.flatnonzero(same & ((places - starts) % 2 == 0))
    count = int(patches.max()) + 1
    waiting = np.cumsum(np.bincount(owners[opens], minlength=count) - np.bincount(owners[opens + 1], minlength=count))
    return np.append(0, np.cumsum(waiting == 0)[:-1])[patches]
