"""Runs to draw."""

import pytest
from drawings import rows

from jointsdf.study.collect import collect
from jointsdf.study.groups import Group, group_runs


@pytest.fixture
def group() -> Group:
    (only,) = group_runs(collect(rows()))
    return only
