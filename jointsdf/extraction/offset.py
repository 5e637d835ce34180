"""Level sets of a field at a given distance as part-labelled meshes: offset surfaces."""

import logging

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.errors import InputError, require_number
from jointsdf.extraction.extractor import Extraction
from jointsdf.model.field import JointField
from jointsdf.values import BOX, LabelledMesh

RIM = 129  # points along each side of the box's faces, at which a level set that leaves it is found
TOUCHING = 1e-6  # of the box: vertices so near to its faces are on them
DEPTHS = 64  # points along each side of the box, among which the deepest one is found

log = logging.getLogger(__name__)


def offset_mesh(field: JointField, distance: float, extraction: Extraction) -> LabelledMesh:
    """Mesh of the points at a signed distance, by the extraction that makes a run's mesh.

    Each point of it has the part of the surface that the gradient leads to from there. The field is a distance only
    within the training box, so a level set that leaves the box is refused.

    Args:
        field: The fitted field.
        distance: File units, negative inside.
        extraction: Of the level set; with `sharp` also its creases.

    Returns:
        The closed mesh, file frame.

    Raises:
        InputError: The level set leaves the training box, or there is none; one line with those that there are.
    """
    require_number("distance", distance)
    level = np.float32(distance / float(field.scale))
    if level and field.far is None:
        log.warning("this field is no distance away from its surface (trunk.far=none): its offsets are rough")
    lowest = _refuse_leaving(field, distance, float(level))

    def sdf(points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        return np.asarray(field.network_sdf(points) - level)

    def differential(points: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, " n"], Float[ndarray, "n 3"]]:
        values, slopes = field.network_differential(points)
        return np.asarray(values - level), slopes

    def label(points: Float[ndarray, "n 3"]) -> Int[ndarray, " n"]:
        return field.network_part(field.network_projection(points) if level else points)

    mesh = extraction.labelled_mesh(sdf, label, field.normalisation, differential)
    if mesh.is_empty:
        deepest = min(_least(field, _box_points(DEPTHS)), 0.0) * float(field.scale)
        raise InputError(f"offset {distance:g}: there is no surface; the field goes down to {deepest:.4g}, give more")
    if np.abs(field.normalisation.forward(mesh.vertices)).max() > BOX * (1 - TOUCHING):  # between those points
        raise _leaving(field, distance, lowest)
    return mesh


def _refuse_leaving(field: JointField, distance: float, level: float) -> float:
    """Lowest value on the faces of the training box, network length units; an error where the level is not below."""
    axis = np.linspace(-BOX, BOX, RIM)
    u, v = np.meshgrid(axis, axis)
    faces = [np.insert(np.stack([u.ravel(), v.ravel()], 1), k, side, axis=1) for k in range(3) for side in (-BOX, BOX)]
    lowest = _least(field, np.concatenate(faces))
    if lowest <= 0:
        raise InputError(f"offset {distance:g}: the surface itself leaves the training box; fit the field again")
    if lowest <= level:
        raise _leaving(field, distance, lowest)
    return lowest


def _leaving(field: JointField, distance: float, lowest: float) -> InputError:
    most = lowest * float(field.scale)
    return InputError(f"offset {distance:g}: its surface leaves the training box; give less than {most:.4g}")


def _box_points(count: int) -> Float[ndarray, "n 3"]:
    axis = np.linspace(-BOX, BOX, count)
    return np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)


def _least(field: JointField, points: Float[ndarray, "n 3"]) -> float:
    return float(field.network_sdf(points.astype(np.float32)).min())
