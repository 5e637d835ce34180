"""Limits in seconds of one core: loading, labelling, reporting, tables."""

import os
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh

from benchmarks.table import Row
from jointsdf.runs.csv import read_committed
from jointsdf.runs.row import ResultRow
from jointsdf.shapes import abc, load
from jointsdf.shapes.builtin import BUILTINS
from jointsdf.shapes.mesh_report import mesh_report
from jointsdf.shapes.segmentation.hierarchy import build_hierarchy
from jointsdf.study.tables.write import write_tables
from jointsdf.values import LabelledMesh, Shape

FACES, RUNS = 40_000, 1000


def rows(faces: int = FACES, runs: int = RUNS, most: int = 50) -> list[Row]:
    """CPU seconds beside what is allowed.

    Args:
        faces: Of the mesh that is labelled and reported on.
        runs: That are put into tables.
        most: Shapes of each catalogue.
    """
    solid = torus(faces)
    shape = Shape("torus", solid, "", "builtin", True)
    root = os.environ.get("JOINTSDF_ABC", "")
    real = [name for name in abc.catalogue() if root and abc.mesh_path(name, root).is_file()][:most]
    parts = list(BUILTINS)[:most]
    whole = faces >= FACES and runs >= RUNS and most >= len(BUILTINS)
    cases: list[tuple[str, float, Callable[[], object]]] = [
        (f"{len(parts)} built-in parts", 10.0, lambda: [load(name, abc_root="") for name in parts]),
        (f"geometric labels of {faces} faces", 3.0, lambda: build_hierarchy(solid, None)),
        (f"the report on {faces} faces", 0.5, lambda: mesh_report(shape)),
        (f"tables of {runs} runs", 10.0, lambda: tables(runs)),
    ]
    found = [allowed(*case) for case in cases]
    if real:
        slowest = max(cpu_seconds(lambda name=name: load(name, abc_root=root)) for name in real)
        found.append(row(f"the slowest of {len(real)} ABC shapes to load", 3.0, slowest))
    return found if whole else [replace(item, target=None) for item in found]


def allowed(what: str, seconds: float, work: Callable[[], object]) -> Row:
    """A row of the second time: the first one loads and caches what all later ones use."""
    cpu_seconds(work)
    return row(what, seconds, cpu_seconds(work))


def row(what: str, allowed_seconds: float, taken: float) -> Row:
    """Seconds beside their limit."""
    return Row(what, "allowed CPU seconds", taken, allowed_seconds, "s", taken / allowed_seconds, 1.0, at_least=False)


def cpu_seconds(work: Callable[[], object]) -> float:
    """Of this process, all threads together."""
    start = time.process_time()
    work()
    return time.process_time() - start


def torus(faces: int) -> LabelledMesh:
    """In nine parts, which follow nothing of its shape."""
    around = round((faces / 4) ** 0.5)
    mesh = trimesh.creation.torus(1.0, 0.3, major_sections=2 * around, minor_sections=around)
    return LabelledMesh(np.array(mesh.vertices), np.array(mesh.faces), np.arange(len(mesh.faces)) % 9)


def tables(runs: int) -> None:
    """Every table of so many rows: committed ones, under seeds of their own."""
    results = Path(__file__).parents[1] / "results"
    known = read_committed(results)[0]
    main = [found for found in known if found.study == "main"]
    many: list[ResultRow] = [replace(main[k % len(main)], seed=k // len(main)) for k in range(runs)]
    with tempfile.TemporaryDirectory() as folder:
        write_tables(many, Path(folder), results)
        assert any(Path(folder).rglob("*.csv")), "no table was written"
