"""Offsets of fields that are known distances: in file units, labelled by the surface, refused where there is none."""

from collections.abc import Callable

import numpy as np
import pytest
import torch
from analytic import box_distance, sphere_distance
from solids import as_trimesh

from jointsdf.errors import InputError
from jointsdf.extraction.extractor import Extraction
from jointsdf.extraction.offset import offset_mesh
from jointsdf.model.closest import onto_surface
from jointsdf.model.far_grid import FarGrid
from jointsdf.model.field import JointField
from jointsdf.values import Normalisation

FRAME = Normalisation(np.array([100.0, -20.0, 3.5]), 10.0)
HALF = (0.7, 0.5, 0.4)
GRID = Extraction(64)


class KnownField(JointField):
    """A field whose distance and parts are given; part 3 above the middle, part 8 below."""

    def __init__(self, distance: Callable[[torch.Tensor], torch.Tensor]) -> None:
        super().__init__({"width": 8, "depth": 1, "tap": 1}, {"name": "none"}, np.arange(0), FRAME)
        self.distance = distance
        self.far = FarGrid(8)

    def network_sdf(self, points: np.ndarray) -> np.ndarray:
        return self.distance(torch.from_numpy(points)).numpy()

    def network_differential(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values, grad = self._first(torch.from_numpy(points))
        return values.numpy(), grad.numpy()

    def _first(self, points: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        at = points.detach().requires_grad_()
        with torch.enable_grad():
            values = self.distance(at)
            (grad,) = torch.autograd.grad(values.sum(), at)
        return values.detach(), grad

    def network_part(self, points: np.ndarray) -> np.ndarray:
        assert np.abs(self.network_sdf(points)).max() < 1e-4, "parts are asked on the surface"
        return np.where(points[:, 2] > 0, 3, 8)


def ball() -> KnownField:
    return KnownField(lambda points: sphere_distance(points, 0.6))


@pytest.mark.parametrize("distance", [2.0, -1.5])
@pytest.mark.parametrize("borders", ["majority", "split"])
def test_offsets_of_a_ball_are_balls_with_its_parts(distance: float, borders: str) -> None:
    mesh = offset_mesh(ball(), distance, Extraction(64, borders=borders))
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices - FRAME.centre, axis=1), 6 + distance, atol=0.02)
    assert as_trimesh(mesh).is_watertight
    assert as_trimesh(mesh).volume == pytest.approx(4 / 3 * np.pi * (6 + distance) ** 3, rel=0.01)
    heights = mesh.vertices[mesh.faces][:, :, 2].mean(axis=1) - FRAME.centre[2]
    clear = np.abs(heights) > 0.5
    np.testing.assert_array_equal(mesh.labels[clear], np.where(heights > 0, 3, 8)[clear])


def test_an_inset_of_a_box_is_a_smaller_box_and_sharp_where_asked() -> None:
    field = KnownField(lambda points: box_distance(points, HALF))
    mesh = offset_mesh(field, -1.0, Extraction(64, sharp=True))
    extents = np.ptp(mesh.vertices, axis=0)
    np.testing.assert_allclose(extents, 2 * (10 * np.array(HALF) - 1), atol=0.02)
    assert as_trimesh(mesh).volume == pytest.approx(extents.prod(), rel=3e-3)


def test_a_level_set_beyond_the_box_or_deeper_than_the_shape_names_what_there_is() -> None:
    with pytest.raises(InputError, match=r"^offset 5: its surface leaves the training box; give less than 5$"):
        offset_mesh(ball(), 5.0, GRID)
    with pytest.raises(InputError, match=r"^offset -7: there is no surface; the field goes down to -5\.[6-9]\d*, give"):
        offset_mesh(ball(), -7.0, GRID)
    with pytest.raises(InputError, match=r"^offset 0: the surface itself leaves the training box"):
        offset_mesh(KnownField(lambda points: sphere_distance(points, 1.2)), 0.0, GRID)
    with pytest.raises(InputError, match=r"^distance=nan"):
        offset_mesh(ball(), float("nan"), GRID)


def test_a_field_that_is_no_distance_is_said_to_be_rough(caplog: pytest.LogCaptureFixture) -> None:
    field = ball()
    field.far = None
    offset_mesh(field, 1.0, GRID)
    assert "no distance away from its surface" in caplog.text


def test_a_projection_ends_on_the_surface() -> None:
    points = np.random.default_rng(0).uniform(-1, 1, (50, 3)).astype(np.float32)
    found = onto_surface(torch.from_numpy(points), ball()._first)
    assert found.reached.all()
    np.testing.assert_allclose(np.linalg.norm(ball().network_projection(points), axis=1), 0.6, atol=2e-5)
