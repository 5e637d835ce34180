"""Fast winding numbers against the exact sum of solid angles."""

import igl
import numpy as np
import pytest
import trimesh

from jointsdf.geometry.winding import WindingNumber


@pytest.mark.parametrize(("scale", "offset"), [(1.0, 0.0), (1e-6, 0.0), (1e9, 0.0), (1.0, 4e6)])
@pytest.mark.parametrize("kept", [1280, 1000])
def test_it_is_the_sum_of_solid_angles_in_any_unit_and_place(scale: float, offset: float, kept: int) -> None:
    ball = trimesh.creation.icosphere(3)
    vertices, faces = np.array(ball.vertices), np.array(ball.faces[:kept])
    points = np.random.default_rng(0).uniform(-1.2, 1.2, (2000, 3))
    exact = igl.winding_number(vertices, faces, points)
    found = WindingNumber(vertices * scale + offset, faces)
    np.testing.assert_allclose(found.at(points * scale + offset), exact, atol=0.02)
    clear = np.abs(exact - 0.5) > 0.02
    np.testing.assert_array_equal(found.encloses(points * scale + offset)[clear], exact[clear] > 0.5)
