"""Components, Euler number and volume of known solids."""

import numpy as np
import pytest
import trimesh
from surface_samples import cube, labelled

from jointsdf.geometry.topology import topology
from jointsdf.values import LabelledMesh


@pytest.mark.parametrize(
    ("mesh", "components", "euler"),
    [
        (trimesh.creation.box(), 1, 2),
        (trimesh.creation.torus(1.0, 0.3), 1, 0),
        (trimesh.creation.icosphere() + trimesh.creation.box().apply_translation((9, 0, 0)), 2, 4),
    ],
    ids=["box", "torus", "two"],
)
def test_topology_of_known_solids(mesh, components, euler):
    found = topology(labelled(mesh))
    assert (found["components"], found["euler"]) == (components, euler)
    assert found["volume"] == pytest.approx(mesh.volume, rel=1e-9)


def test_unused_vertices_do_not_count():
    mesh = cube()
    assert topology(LabelledMesh(np.r_[[[9.0, 9, 9]], mesh.vertices], mesh.faces + 1, mesh.labels)) == topology(mesh)
