"""How good a fit is, in words: lengths in file units, from the protocol whose frame is the ground truth's."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from study_rows import make_row

from jointsdf.evaluation.protocol import Protocol
from jointsdf.experiment.summary import describe
from jointsdf.values import LabelledMesh, Shape, Unit

UNIT, OWN = Protocol("unit", 10, "truth", {}), Protocol("flatcad", 10, "own", {})
SCORES = {"surface_p99": 0.0012, "parts_pred": 5.0, "parts_gt": 6.0, "components": 1.0, "components_gt": 1.0}


@pytest.fixture
def box() -> LabelledMesh:
    solid = trimesh.creation.box((50.0, 20.0, 10.0))
    return LabelledMesh(np.array(solid.vertices), np.array(solid.faces), np.arange(12) // 2)


def shape_of(mesh: LabelledMesh) -> Shape:
    return Shape("box", mesh, "", "array", watertight=True, unit=Unit("in", 0.0254))


def test_lengths_are_in_file_units_and_shares_of_the_longest_side(box: LabelledMesh) -> None:
    """0.12% of 50 is 0.06; the prediction's own size does not count."""
    larger = replace(box, vertices=3 * box.vertices)
    for mesh in (box, larger):
        assert describe(make_row(**SCORES), {"unit": UNIT}, shape_of(box), mesh) == (
            "99% of the surface is within 0.06 in of the part (0.12% of its longest side), 5 of 6 parts, "
            "watertight, one piece"
        )


def test_a_hole_and_pieces_are_said_and_parts_only_where_there_are_some(box: LabelledMesh) -> None:
    open_ = replace(box, faces=box.faces[1:], labels=box.labels[1:])
    row = make_row(parts=0, **SCORES | {"components": 3.0})
    said = describe(row, {"unit": UNIT}, shape_of(box), open_)
    assert said.endswith("longest side), not watertight, 3 pieces where the part has 1")


def test_a_frame_of_the_meshs_own_is_not_quoted_nor_what_was_not_measured(box: LabelledMesh) -> None:
    nothing = LabelledMesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64), np.zeros(0, dtype=np.int64))
    assert describe(make_row(**SCORES), {"flatcad": OWN}, shape_of(box), box) == ""
    assert describe(make_row(**SCORES), {"flatcad": OWN, "unit": UNIT}, shape_of(box), box)
    assert describe(make_row(surface_p99=0.1), {"unit": UNIT}, shape_of(box), box) == ""
    assert describe(make_row(**SCORES), {"unit": UNIT}, shape_of(box), nothing) == ""
