"""Faces that `extraction.simplify` leaves of extracted meshes, where the surface is as near to the truth as before.

The fields are whole fits of `fast` on grids of their own choice. Distances are to the true surface, in shares of the
longest side; the bound is the largest distance that simplification may add to any of them.
"""

import time
from collections.abc import Sequence
from dataclasses import replace

import torch

from benchmarks.scene import composed, fitted, measured
from benchmarks.table import Row, machine
from jointsdf.evaluation.protocol import GroundTruth
from jointsdf.experiment import build
from jointsdf.extraction.extractor import Extraction
from jointsdf.extraction.simplification import simplify
from jointsdf.values import LabelledMesh

SHAPES = ("part_01",)
BOUNDS = (1e-4, 3e-4)
FEW = {3e-4: 0.11}  # share of the faces left that is claimed, of bounds
SAME = 1.1  # surface_p99 after, of that before: what is claimed


def rows(shapes: Sequence[str] = SHAPES, bounds: Sequence[float] = BOUNDS, overrides: Sequence[str] = ()) -> list[Row]:
    """Faces, distances and seconds with and without simplification, of each shape with and without sharp creases.

    Args:
        shapes: Names.
        bounds: Largest distances of both surfaces from each other, of the longest side.
        overrides: Of the configs, to make the fits smaller; then nothing is claimed.
    """
    found = []
    for name in shapes:
        cfg = composed(f"shape={name}", *overrides)
        shape, module = fitted(cfg)
        field = module.field
        measures = build.measures(cfg, 256 if cfg.extraction.resolution == "auto" else cfg.extraction.resolution)
        truth = GroundTruth(shape.mesh, measures.protocols)
        with machine(torch.get_num_threads(), measured(cfg, module).matmul):
            for sharp in (False, True):
                extraction: Extraction = replace(measures.extraction, sharp=sharp, simplify=0)
                start = time.perf_counter()
                mesh = extraction.labelled_mesh(
                    field.network_sdf, field.network_part, field.normalisation, field.network_differential
                )
                seconds = time.perf_counter() - start
                what = f"{'sharp' if sharp else 'sparse'} extraction, {name}"
                for bound in bounds:
                    found += simplified(what, mesh, truth, bound, seconds)
    return [replace(row, target=None) for row in found] if overrides else found


def simplified(what: str, mesh: LabelledMesh, truth: GroundTruth, bound: float, seconds: float) -> list[Row]:
    """Rows of one mesh and bound, beside the mesh as it was and the seconds that its extraction took."""
    start = time.perf_counter()
    fewer = simplify(mesh, bound)
    taken = time.perf_counter() - start
    before, after = (truth.scores(each)["unit"]["surface_p99"] for each in (mesh, fewer))
    faces, all_faces = len(fewer.faces), len(mesh.faces)
    what = f"{what}, simplify={bound:g}"
    return [
        Row(what, "all faces", faces, all_faces, "faces", faces / all_faces, FEW.get(bound), at_least=False),
        Row(f"{what}: surface_p99", "before", after, before, "", after / before, SAME, at_least=False),
        Row(f"{what}: seconds", "extraction", taken, seconds, "s", taken / seconds),
    ]
