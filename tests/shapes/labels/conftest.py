"""A bar whose parts PartField finds."""

from pathlib import Path

import pytest
from partfield_output import BAR


@pytest.fixture
def bar(tmp_path: Path) -> Path:
    path = tmp_path / "bar.v2.ply"
    BAR.export(path)
    return path
