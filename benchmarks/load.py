"""Load: seconds and memory of meshes, part counts, rows, points and logs far larger than those of the benchmark.

Each case is a process of its own, whose peak memory the system counts. `make load` prints the table of docs/trust.md;
`python -m benchmarks.load CASE` is one case in this process.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import torch

from benchmarks.limits import tables, torus
from benchmarks.scene import built, composed
from jointsdf.data.point_cloud import Cloud
from jointsdf.evaluation.protocol import GroundTruth
from jointsdf.experiment import build
from jointsdf.extraction.extractor import Extraction
from jointsdf.extraction.resolution import refine_until_stable
from jointsdf.geometry.distance import network_distance
from jointsdf.model.field import JointField
from jointsdf.shapes import load
from jointsdf.shapes.mesh_report import mesh_report
from jointsdf.study.figures.loss_curves import read_curves
from jointsdf.values import UNMOVED, LabelledMesh
from jointsdf.viewing.export import write_mesh

HEAD = {"name": "siren", "widths": [16, 16], "omega": 30.0}


@contextmanager
def stage(name: str) -> Iterator[None]:
    """Print the CPU seconds of the block."""
    start = time.process_time()
    yield
    sys.stdout.write(f"  {name}: {time.process_time() - start:.1f} s\n")
    sys.stdout.flush()


def mesh(faces: int, parts: int = 9, points: int = 250_000) -> None:
    """Load and repair a mesh file, report, sample, measure distances, and score it against itself.

    Args:
        faces: About so many, of a torus.
        parts: Bands of the torus, one label each.
        points: Of the distances.
    """
    solid = torus(faces)
    solid = replace(solid, labels=np.arange(len(solid.faces)) * parts // len(solid.faces))
    with tempfile.TemporaryDirectory() as folder:
        write_mesh(Path(folder), solid)
        with stage("load and repair"):
            shape = load(f"{folder}/mesh.ply", abc_root="")
    with stage("report"):
        assert mesh_report(shape).watertight
    with stage("sample"):
        cloud = Cloud.of(shape.mesh, count=30_000, seed=0)
    with stage("distances"):
        where = np.random.default_rng(0).uniform(-1, 1, (points, 3))
        assert np.isfinite(network_distance(shape, cloud.normalisation).signed(where)).all()
    with stage("scores"):
        protocols = build.measures(composed(), 64).protocols
        scores = GroundTruth(shape.mesh, protocols).scores(replace(shape.mesh))
    assert scores["unit"]["miou_exact"] == 1


def field(parts: int = 7, width: int = 16, scale: float = 1.0) -> JointField:
    """A field of random weights, those of its trunk times a factor: noise from about 5."""
    torch.manual_seed(0)
    made = JointField({"width": width, "depth": 4, "tap": 2}, HEAD, np.arange(parts), UNMOVED)
    with torch.no_grad():
        for layer in made.trunk.sine_layers:
            layer.linear.weight.mul_(scale)
    return made.eval()


def query(points: int) -> None:
    """All answers at so many points at once."""
    where = np.random.default_rng(0).uniform(-1, 1, (points, 3))
    assert len(field().query(where).sdf) == points


def noise(resolution: int, scale: float) -> None:
    """Extract a field of random weights on a grid that `auto` chose."""
    made = field(scale=scale)
    extraction, surface = refine_until_stable(Extraction(resolution=resolution), made.network_sdf)
    sys.stdout.write(f"  {len(surface.faces):,} faces on {extraction.resolution}^3\n")


def samples_of_parts(parts: int, steps: int = 20) -> None:
    """Prepare a run on a mesh of many parts and draw the samples of some steps."""
    solid = torus(40_000)
    many = LabelledMesh(solid.vertices, solid.faces, np.arange(len(solid.faces)) * parts // len(solid.faces))
    _, data, module = built(composed("recipe=smoke", "head=siren"), many)
    for step in range(steps):
        module.training_step(data.sampler.draw(step), step)


def logs(runs: int, steps: int = 300) -> None:
    """Read the loss curves of so many runs."""
    from torch.utils.tensorboard import SummaryWriter

    with tempfile.TemporaryDirectory() as folder:
        with SummaryWriter(folder) as board:
            for step in range(steps):
                for term in range(7):
                    board.add_scalar(f"loss/{term}", 1 / (1 + step), step)
        with stage("read"):
            assert all(len(read_curves(Path(folder))) == 7 for _ in range(runs))


CASES: dict[str, Callable[[], None]] = {
    "mesh of 10^5 faces": partial(mesh, 100_000),
    "mesh of 5 x 10^5 faces": partial(mesh, 500_000),
    "mesh of 2 x 10^6 faces": partial(mesh, 2_000_000),
    "mesh of 200 parts": partial(mesh, 40_000, 200),
    "mesh of 1,280 parts": partial(mesh, 40_000, 1280),
    "steps of 1,280 parts": partial(samples_of_parts, 1280),
    "tables of 10,000 rows": partial(tables, 10_000),
    "random weights on 512^3": partial(noise, 512, 1.0),
    "noise on 512^3": partial(noise, 512, 5.0),
    "query of 10^7 points": partial(query, 10_000_000),
    "loss curves of 500 runs": partial(logs, 500),
}


def main(names: list[str]) -> None:
    """Run the named case here, or each case in a process of its own, with a line of the table."""
    if names:
        CASES[names[0]]()
        return
    sys.stdout.write("| case | CPU seconds | seconds | MiB |\n|---|---|---|---|\n")
    for name in CASES:
        began = time.monotonic()
        process = subprocess.Popen([sys.executable, "-m", "benchmarks.load", name], stdout=subprocess.DEVNULL)
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        cpu, wall = used.ru_utime + used.ru_stime, time.monotonic() - began
        held = f"| {cpu:.0f} | {wall:.0f} | {used.ru_maxrss >> 10} |" if status == 0 else "| ended by an error |||"
        sys.stdout.write(f"| {name} {held}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main(sys.argv[1:])
