"""Two random clouds."""

import numpy as np
import pytest
from surface_samples import cloud, directions


@pytest.fixture
def clouds():
    rng = np.random.default_rng(0)
    return [cloud(rng.random((n, 3)) * 0.3, rng.integers(-1, 5, n), directions(rng, n)) for n in (300, 200)]
