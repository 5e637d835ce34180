"""Scores of the field itself, not of its mesh: whether it is a distance away from the surface as well."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from jointsdf.evaluation.protocol import Protocol, Scores, bounding_frame
from jointsdf.geometry.distance import network_distance
from jointsdf.model.field import JointField
from jointsdf.values import BOX, Shape


def field_scores(protocols: Mapping[str, Protocol], shape: Shape, field: JointField) -> Scores:
    """Score a field by the measures of fields of every protocol, in the ground truth's unit frame.

    Args:
        protocols: By name.
        shape: Ground truth.
        field: The fitted field.

    Returns:
        Protocol -> column -> value; no columns for a protocol without such measures.
    """
    if not any(protocol.field for protocol in protocols.values()):
        return {name: {} for name in protocols}
    frame = bounding_frame(shape.mesh)
    exact = network_distance(shape, frame)
    corners = np.array([[-BOX] * 3, [BOX] * 3])
    box = frame.forward(field.normalisation.inverse(corners))

    def in_unit_frame(points: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, " n"], Float[ndarray, "n 3"]]:
        found = field.query(frame.inverse(points), what=("sdf", "gradient"))
        return found.sdf.astype(np.float64) / frame.scale, found.gradient.astype(np.float64)

    found: Scores = {}
    for name, protocol in protocols.items():
        found[name] = {}
        for measure in protocol.field.values():
            found[name] |= measure(in_unit_frame, exact, box)
    return found
