"""Terms on an exact distance."""

from collections.abc import Callable

import pytest
from exact_steps import Field, box, cylinder, exact_step, plane, sphere
from torch import Tensor

from jointsdf.losses.dirichlet import Dirichlet
from jointsdf.losses.eikonal import Eikonal
from jointsdf.losses.far_distance import FarDistance
from jointsdf.losses.far_gradients import FarGradients
from jointsdf.losses.near_distance import NearDistance
from jointsdf.losses.normals import Normals
from jointsdf.losses.signed_distance import SignedDistance
from jointsdf.losses.singular_hessian import SingularHessian
from jointsdf.values import Step


@pytest.mark.parametrize("field", [sphere, box, plane, cylinder])
@pytest.mark.parametrize(
    "term",
    [
        Dirichlet(),
        SignedDistance(),
        NearDistance(),
        FarDistance(),
        FarGradients(),
        Normals(),
        Eikonal("abs", ["manifold", "shell"]),
        Eikonal("squared", ["manifold", "non_manifold", "shell"]),
        Eikonal("abs", ["pool"]),
        Eikonal("quadratic", ["non_manifold", "shell"]),
        SingularHessian(),
    ],
    ids=str,
)
def test_exact_distance_costs_nothing(field: Field, term: Callable[[Step], Tensor]) -> None:
    assert term(exact_step(field)).item() == pytest.approx(0, abs=1e-12)
