"""Simplification of a part-labelled surface within a two-sided bound that is certified afterwards."""

import logging
from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Int
from numpy import ndarray

from jointsdf.extraction.flat_regions import merge_flat_regions
from jointsdf.extraction.surface_changes import Checked, check, faces_lacking, unsound_faces
from jointsdf.geometry.distance import ClosestPoint
from jointsdf.geometry.mesh import edge_keys, used_vertices
from jointsdf.geometry.topology import topology
from jointsdf.values import LabelledMesh

STAGES = ((0.1, 0.2, 0.3, 0.4, 0.5), (0.7,))  # tolerances of the merging, of the bound
GENTLE = (0.05, 0.1, 0.15, 0.2, 0.25)  # where those were in vain
ATTEMPTS = 12  # of a stage, each with more faces kept as they are

log = logging.getLogger(__name__)


def simplify(mesh: LabelledMesh, bound: int | float) -> LabelledMesh:
    """Merge the faces of nearly flat regions, and undo it where that goes wrong.

    After merging, it is checked that every part is within the bound of the same part before, and the other way round;
    that no new face passes through another, is folded back or has no height; and that components, Euler characteristic
    and rims are what they were. Faces under what fails are kept as they are, and merging starts again. A second stage
    merges what the first one left with greater tolerances, under the same checks.

    Args:
        mesh: The surface, any frame.
        bound: Largest distance of each surface from the other, of the longest side.

    Returns:
        The surface with fewer faces; the given one where merging fails.
    """
    if bound == 0 or mesh.is_empty:
        return mesh
    allowed = bound * float(np.ptp(mesh.vertices[mesh.faces].reshape(-1, 3), axis=0).max())
    unsound = mesh.faces[unsound_faces(mesh, np.ones(len(mesh.faces), dtype=bool))]
    found = Checked(mesh, np.zeros(len(mesh.faces), dtype=bool), np.zeros(len(mesh.faces), dtype=bool))
    for shares in (*STAGES, GENTLE):
        if shares is GENTLE and found.merged is not mesh:
            break
        merged = _merged_within(mesh, found, allowed, shares, _about(found.merged, unsound.reshape(-1)))
        if merged is None:
            log.info("simplified: no more within the bound by tolerances up to %g of it", shares[-1])
        else:
            found = merged
    if found.merged is mesh:
        log.warning("the mesh is not simplified: its %d faces do not merge within the bound", len(mesh.faces))
        return mesh
    log.info("simplified: %d of %d faces", len(found.merged.faces), len(mesh.faces))
    used, faces = used_vertices(found.merged.faces, len(mesh.vertices))
    return LabelledMesh(mesh.vertices[used], faces, found.merged.labels)


def _merged_within(
    mesh: LabelledMesh, base: Checked, allowed: float, shares: Sequence[float], fixed: Bool[ndarray, " f"]
) -> Checked | None:
    """Merge with more and more faces kept as they are, until every check holds; None where it does not in time.

    Args:
        mesh: The surface that nothing may be far from.
        base: What is merged: that surface, or what an earlier stage made of it.
        allowed: Largest distance of each surface from the other, mesh units.
        shares: Tolerances of the merging, one after another, of `allowed`.
        fixed: Faces of `base` to keep from the start.
    """
    last = base
    for attempt in range(ATTEMPTS):
        merged = merge_flat_regions(base.merged, [share * allowed for share in shares], fixed)
        if merged is None or merged.is_empty:
            return None
        torn = np.setxor1d(_odd_edges(mesh), _odd_edges(merged))
        if len(torn):
            fixed = fixed | _about(base.merged, np.concatenate(np.divmod(torn, len(mesh.vertices))))
            continue
        if not _same_topology(mesh, merged):
            return None
        last = check(mesh, merged, allowed, last)
        if not (last.lost.any() or last.wrong.any()):
            return last
        under = _under(mesh, base.merged, last)
        log.info("simplified, attempt %d: %d of %d faces restored", attempt + 1, int(under.sum()), len(under))
        fixed = fixed | (_about(base.merged, base.merged.faces[under].reshape(-1)) if attempt else under)
    return None


def _under(mesh: LabelledMesh, base: LabelledMesh, checked: Checked) -> Bool[ndarray, " f"]:
    """Faces of the base where something is wrong: those whose nearest merged face is wrong, or above a lost one."""
    merged = checked.merged
    closest = ClosestPoint(merged)
    bad = checked.wrong.copy()
    bad[closest.query(mesh.vertices[mesh.faces[checked.lost]].mean(axis=1))[1]] = True
    gone = np.flatnonzero(faces_lacking(base, merged))
    above = closest.query(base.vertices[base.faces[gone]].mean(axis=1))[1]
    under = _about(base, merged.faces[checked.wrong].reshape(-1))  # a wrong face may be nearest to none
    under[gone[bad[above]]] = True
    return under


def _same_topology(mesh: LabelledMesh, merged: LabelledMesh) -> bool:
    """True if components and Euler characteristic are equal."""
    one, other = topology(mesh), topology(merged)
    return one["components"] == other["components"] and one["euler"] == other["euler"]


def _about(mesh: LabelledMesh, vertices: Int[ndarray, " n"]) -> Bool[ndarray, " f"]:
    """Faces at some vertices."""
    return np.asarray(np.isin(mesh.faces, vertices).any(axis=1))


def _odd_edges(mesh: LabelledMesh) -> Int[ndarray, " e"]:
    """Edges that have not exactly two faces, by their keys."""
    keys, uses = np.unique(edge_keys(mesh.faces.astype(np.int64), len(mesh.vertices)), return_counts=True)
    odd: Int[ndarray, " e"] = keys[uses != 2]
    return odd
