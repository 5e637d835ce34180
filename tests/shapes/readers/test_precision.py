"""Which coordinates are warned of."""

import numpy as np
import pytest

from jointsdf.shapes.readers.precision import warn_of_rounding

CUBE = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])


@pytest.mark.parametrize(
    ("vertices", "spacing"),
    [
        (CUBE, None),
        (CUBE + 100, None),  # spacing 2^-17 < 1e-5
        (CUBE + 200, "1.5e-05 (0.0015 %"),
        (CUBE - 200, "1.5e-05 (0.0015 %"),
        (CUBE * 1000 + 1e6, "0.062 (0.0063 %"),
        (CUBE + 200.1, None),  # of more digits than 32 bits hold
        (CUBE * 0 + 1e6, None),
        (CUBE + np.array([np.nan, 0, 0]), None),
        (CUBE * float(np.finfo(np.float32).max), None),
        (CUBE * 1e300, None),
        (np.zeros((0, 3)), None),
    ],
)
def test_spacing_is_said_where_it_shows(
    vertices: np.ndarray, spacing: str | None, caplog: pytest.LogCaptureFixture
) -> None:
    warn_of_rounding("a.glb", vertices)
    assert [record.getMessage().partition("rounded to ")[2][: len(spacing or "")] for record in caplog.records] == (
        [] if spacing is None else [spacing]
    )
