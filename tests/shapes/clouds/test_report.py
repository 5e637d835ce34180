"""The report on a cloud says what was done to it."""

import logging

import numpy as np
import pytest
from cloud_files import on_box

from jointsdf.data.corruption import Corruption
from jointsdf.shapes.clouds import report as module
from jointsdf.shapes.clouds.report import CloudReport, cloud_report
from jointsdf.shapes.clouds.sources import load_cloud

CLEAN = on_box(12000)


def report(**corruption: float) -> CloudReport:
    found = Corruption(**corruption).corrupt(CLEAN, 0)
    return cloud_report(load_cloud(points=found.points, normals=found.normals, labels=found.labels, name="scan"))


def test_a_clean_cloud() -> None:
    found = report()
    assert (found.points, found.noise, found.outliers, found.rims, found.with_normals, found.labelled) == (
        *(12000, 0.0, 0.0, 0, 1.0, 1.0),
    )
    # on a plane with the density rho the nearest point is at 0.4697 / sqrt(rho) in the median
    assert found.spacing == pytest.approx(np.sqrt(np.log(2) / np.pi * 40 / 12000), rel=0.03)
    assert found.density == pytest.approx(module.OF_UNIFORM, rel=0.05)
    assert dict(found.parts) == {part: (CLEAN.labels == part).mean() for part in (4, 9)}
    assert found.warnings() == []


def test_what_was_done_is_found(caplog: pytest.LogCaptureFixture) -> None:
    assert report(noise=0.005).noise == pytest.approx(0.02, rel=0.1)
    assert report(density=10.0).density > 7
    assert report(outliers=0.02).outliers == pytest.approx(0.0134, abs=0.002), "a third lie near the surface"
    assert report(missing=0.1).rims >= 1
    with caplog.at_level(logging.INFO):
        report(noise=0.005, outliers=0.02).log(0.1)
    text = caplog.text
    assert "scan: 12000 points" in text
    assert "noise of 0.4" in text
    assert "of the points are alone" in text


def test_a_large_cloud_is_measured_by_some_of_its_points(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = report()
    monkeypatch.setattr(module, "MOST", 4000)
    some = report()
    assert some.points == 12000
    assert some.spacing == pytest.approx(whole.spacing, rel=0.05)
