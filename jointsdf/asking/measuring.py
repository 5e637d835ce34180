"""Measures of a fitted field and of its mesh, as a table, json and csv."""

import json
import logging
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float
from numpy import ndarray

from jointsdf.asking.asked_run import AskedRun
from jointsdf.errors import InputError
from jointsdf.evaluation.field_integrals import measure_field
from jointsdf.evaluation.mass_properties import Measures, measure_mesh
from jointsdf.geometry.topology import is_closed
from jointsdf.phases import phase
from jointsdf.runs.files import write_atomically

log = logging.getLogger(__name__)


def measure_run(run: AskedRun, *, resolution: int) -> dict[str, Measures]:
    """Measures of the field's solid by integrals of the field, and by its mesh; by `field` and `mesh`, file units.

    Raises:
        InputError: The field has no surface, or a grid out of range.
    """
    with phase("measure", "integrals of the field, and its mesh"):
        found = {"field": measure_field(run.field, resolution)}
        mesh = run.mesh()
        if not is_closed(mesh.faces):
            log.warning("the mesh is not closed: its volume, centre and inertia are not those of a solid")
        return {**found, "mesh": measure_mesh(mesh)}


def measure_rows(found: Mapping[str, Measures], unit: str) -> Iterator[tuple[str, str, str, list[float]]]:
    """Quantity, unit, `field` or `mesh`, and numbers: rows of the table."""
    for source, each in found.items():
        yield "volume", f"{unit}^3", source, [each.volume]
        yield "area", f"{unit}^2", source, [each.area]
        yield "centre of mass", unit, source, each.centre.tolist()
        for name, row in zip("xyz", each.inertia.tolist(), strict=True):
            yield f"inertia {name}", f"{unit}^5", source, row
        for part, measure in each.parts.items():
            yield f"part {part} area", f"{unit}^2", source, [measure.area]
            yield f"part {part} centroid", unit, source, measure.centroid.tolist()


def write_measures(found: Mapping[str, Measures], unit: str, out: Path) -> None:
    """Write measures as json, nested, or as csv, a row for each number.

    Raises:
        InputError: Another ending.
    """
    rows = sorted(measure_rows(found, unit), key=lambda row: row[0])
    if out.suffix.lower() == ".csv":
        table = [
            (quantity, axis if len(numbers) > 1 else "", unit, source, number)
            for quantity, unit, source, numbers in rows
            for axis, number in zip("xyz", numbers, strict=False)
        ]
        columns = ["quantity", "axis", "unit", "source", "value"]
        write_atomically(out, pd.DataFrame(table, columns=columns).to_csv(index=False, lineterminator="\n"))
    elif out.suffix.lower() == ".json":
        content = {"unit": unit, **{source: _as_json(each) for source, each in found.items()}}
        write_atomically(out, json.dumps(content, indent=1, allow_nan=False) + "\n")
    else:
        raise InputError(f"--out {out}: give a name that ends in json or csv")


def _as_json(each: Measures) -> dict[str, Any]:
    parts = {str(part): {"area": m.area, "centroid": _plain(m.centroid)} for part, m in each.parts.items()}
    return {
        "volume": each.volume,
        "area": each.area,
        "centre_of_mass": _plain(each.centre),
        "inertia": [_plain(row) for row in each.inertia],
        "parts": parts,
    }


def _plain(numbers: Float[ndarray, "3"]) -> list[float | None]:
    return [number if np.isfinite(number) else None for number in numbers.tolist()]
