"""Pieces, holes and volume of both meshes."""

import numpy as np
import pytest
import trimesh
from surface_samples import cube, labelled, score

from jointsdf.metrics.topology import Topology
from jointsdf.values import LabelledMesh


def test_topology_is_reported_for_both_meshes_and_sees_orientation():
    inside_out = LabelledMesh(cube().vertices, cube().faces[:, ::-1].copy(), cube().labels)
    found = score(Topology(), inside_out, labelled(trimesh.creation.torus(1.0, 0.3)))
    assert found["volume"] == pytest.approx(-1.0)
    assert (found["components"], found["euler"], found["components_gt"], found["euler_gt"]) == (1, 2, 1, 0)
    assert found["volume_gt"] == pytest.approx(2 * np.pi**2 * 0.09, rel=0.05)
