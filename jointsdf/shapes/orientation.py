"""Outward winding of every component: closed ones by volume and nesting, open ones by rays."""

import logging
from dataclasses import dataclass

import igl
import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from jointsdf.geometry.mesh import edge_keys
from jointsdf.geometry.topology import (
    component_volumes,
    edge_components,
    is_closed,
    is_consistent,
    side_uses,
    signed_volume,
)
from jointsdf.shapes.doubling import find_twins
from jointsdf.shapes.nesting import nesting_depth
from jointsdf.shapes.partitions import wind_partitions
from jointsdf.shapes.visibility import vote_on_sides

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Patches:
    """Faces that are connected by edges with exactly two faces, wound to agree within each patch.

    Attributes:
        faces: Vertex indices.
        number: Patch of each face, from 0.
        closed: Whether every edge of the patch has exactly two faces.
        one_sided: Whether no winding agrees all over the patch; its faces are as given.
    """

    faces: Int[ndarray, "f 3"]
    number: Int[ndarray, " f"]
    closed: Bool[ndarray, " p"]
    one_sided: Bool[ndarray, " p"]


def orient(
    source: str, vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]
) -> tuple[Int[ndarray, "f 3"], bool]:
    """Wind the faces outward, those of cavities inward; also whether they close a volume consistently.

    Args:
        source: Names the mesh in messages.
        vertices: Positions.
        faces: Vertex indices, none degenerate.
    """
    closed = is_closed(faces)
    if closed and is_consistent(faces) and edge_components(faces).max() == 0:
        if signed_volume(vertices, faces) < 0:
            logger.warning("%s: inside out (negative volume): all faces flipped", source)
            faces = faces[:, ::-1].copy()
        return faces, True
    uses = side_uses(faces)
    if not closed:
        wrong, edges = (uses != 2), round((1 / uses).sum())
        counts = f"{round((1 / uses[wrong]).sum())} of {edges} edges do not have exactly two faces"
        logger.warning("%s: not watertight (%s): the sign comes from the winding number", source, counts)
    patches = _agree(source, faces, uses)
    inverted = _find_inverted(source, vertices, patches)
    wound = np.where(inverted[patches.number][:, None], patches.faces[:, ::-1], patches.faces)
    return wound, closed and not patches.one_sided.any()


def _agree(source: str, faces: Int[ndarray, "f 3"], uses: Int[ndarray, "f 3"]) -> Patches:
    """Flip the faces that disagree with most of their patch."""
    oriented, number = igl.bfs_orient(faces)
    number = np.unique(number, return_inverse=True)[1].reshape(-1)
    flipped = (oriented != faces).any(axis=1)
    mostly_flipped = np.bincount(number, flipped) > 0.5 * np.bincount(number)
    flipped ^= mostly_flipped[number]
    agreed = np.where(flipped[:, None], faces[:, ::-1], faces)
    one_sided = _find_one_sided(agreed, number)
    if one_sided.any():
        logger.warning("%s: has no outside (one-sided surface): the sign comes from the winding number", source)
        agreed = np.where(one_sided[number][:, None], faces, agreed)
        flipped &= ~one_sided[number]
    if flipped.any():
        logger.warning("%s: %d faces were inside out and are flipped to agree with the rest", source, flipped.sum())
    return Patches(agreed, number, np.bincount(number, (uses != 2).any(axis=1)) == 0, one_sided)


def _find_one_sided(faces: Int[ndarray, "f 3"], number: Int[ndarray, " f"]) -> Bool[ndarray, " p"]:
    """Find the patches in which two faces traverse an edge, that no other face has, in one direction."""
    _, edge, uses = np.unique(edge_keys(faces, int(faces.max()) + 1), return_inverse=True, return_counts=True)
    forward = (faces < np.roll(faces, -1, axis=1)).ravel()
    disagree = (uses == 2) & (np.bincount(edge, forward) != 1)
    return np.asarray(np.bincount(number, disagree[edge].reshape(-1, 3).any(axis=1)) > 0)


def _find_inverted(source: str, vertices: ndarray, patches: Patches) -> Bool[ndarray, " p"]:
    """Find the patches to be turned, and say so."""
    bodies = patches.closed & ~patches.one_sided
    sheets = ~patches.closed & ~patches.one_sided
    inverted = np.zeros(len(bodies), dtype=bool)
    if sheets.any():
        votes = vote_on_sides(vertices, patches.faces, patches.number, find_twins(patches.faces) >= 0)
        inverted = sheets & (votes < 0)
        wound = np.where(inverted[patches.number][:, None], patches.faces[:, ::-1], patches.faces)
        inverted |= wind_partitions(wound, patches.number, sheets & (votes == 0))
    volumes = component_volumes(vertices, patches.faces, patches.number)
    inward, depth = bodies & (volumes < 0), np.zeros(len(bodies), dtype=np.int64)
    if np.count_nonzero(bodies) and len(bodies) > 1:
        outward = np.where((inverted | inward)[patches.number][:, None], patches.faces[:, ::-1], patches.faces)
        body = np.where(bodies, np.cumsum(bodies) - 1, -1)[patches.number]
        depth[bodies] = nesting_depth(vertices, outward, body, volumes[bodies])
    cavity = bodies & (depth % 2 == 1)
    turned = inverted | (bodies & (inward != cavity))
    _tell(source, int((turned & ~cavity).sum()), int((turned & cavity).sum()), len(bodies), bool(bodies.all()))
    return turned


def _tell(source: str, inverted: int, cavities: int, patches: int, closed: bool) -> None:
    """Warn of the patches that were turned."""
    if inverted and patches == 1:
        reason = "negative volume" if closed else "rays from its inner side escape"
        logger.warning("%s: inside out (%s): all faces flipped", source, reason)
    elif inverted:
        verb = "was" if inverted == 1 else "were"
        logger.warning("%s: %d of %d components %s inside out: flipped", source, inverted, patches, verb)
    if cavities == 1:
        logger.warning("%s: 1 component lies inside another: taken as a cavity", source)
    elif cavities:
        logger.warning("%s: %d components lie inside others: taken as cavities", source, cavities)
