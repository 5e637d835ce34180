"""Sparse extraction against every grid point evaluated, our way (`dense`) and in the released style.

The released style is the plain network, torch's own matrix products and 5,000 points a call. It is timed on a part of
the grid and scaled to the whole. The field is `part_01` after a short fit. Both cores.

And, as `octree`, against libigl's octree (`octree.py`) on whole fits of `fast`: trusted at slope 1, as of an exact
distance; at a slope that is measured and given a margin; and at slope 1 with the surface followed our way.
"""

import multiprocessing
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import pairwise

import numpy as np
import torch
import trimesh
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import KDTree

from benchmarks.octree import followed_mesh, libigl_mesh, slope_bound
from benchmarks.scene import composed, fitted, measured
from benchmarks.table import Row, interleaved, machine
from jointsdf.extraction.extractor import Extraction, Surface
from jointsdf.extraction.sparse_grid import Grid
from jointsdf.geometry.mesh import edge_keys
from jointsdf.model.field import JointField
from jointsdf.shapes import abc
from jointsdf.training.hardware import freed_memory_kept, peak_memory_mb, reset_peak_memory
from jointsdf.values import BOX, LabelledMesh

CHUNK = 5000  # of the released code
PLATE = (1.0, 0.6, 0.01)  # extents of the thin plate
SECONDS, GIB = 60.0, 4.0  # targets at 1024^3
FITTED = {"part_01": 256, "part_12": 256, "abc_0008": 384}  # shape and its grid, that a run of `fast` takes
SAME = 1e-6  # between vertices, network length units


def rows(
    resolution: int = 256, steps: int = 200, part: int = 500_000, plate: int = 1024, repetitions: int = 2
) -> list[Row]:
    """Seconds of both sides; the meshes of sparse and dense must be the same.

    Args:
        resolution: Grid points along each axis.
        steps: Of the fits.
        part: Grid points timed in the released style.
        plate: Grid points along each axis for the thin plate.
        repetitions: Of the sparse extraction and of the released style.
    """
    cfg = composed(f"trainer.max_steps={steps}")
    _, module = fitted(cfg)
    field, threads = module.field, torch.get_num_threads()
    with machine(threads, measured(cfg, module).matmul):
        points = grid_points(resolution, part)
        surfaces: dict[str, Surface] = {}

        def surface(method: str) -> None:
            surfaces[method] = Extraction(resolution, method).surface(field.network_sdf)

        sparse, style = interleaved(
            repetitions, lambda: surface("sparse"), lambda: released_style(field, points, threads)
        )
        (dense,) = interleaved(1, lambda: surface("dense"), warm_up=False)
        assert_same(surfaces["sparse"], surfaces["dense"])
        style *= resolution**3 / len(points)
        name = f"sparse extraction, {resolution}^3, same mesh"
        whole = resolution == 256
        return [
            Row(name, "our dense path", sparse, dense, "s", dense / sparse, 6.0 if whole else None),
            Row(
                name,
                f"released style, from {len(points) / resolution**3:.0%} of the grid",
                sparse,
                style,
                "s",
                style / sparse,
                20.0 if whole else None,
            ),
            *in_a_new_process(thin_plate, plate, steps),
        ]


def grid_points(resolution: int, count: int) -> Float[ndarray, "n 3"]:
    """Grid points spread evenly over the grid's order."""
    axis = np.linspace(-BOX, BOX, resolution, dtype=np.float32)
    chosen = np.linspace(0, resolution**3 - 1, min(count, resolution**3)).astype(np.int64)
    return np.stack([axis[index] for index in np.unravel_index(chosen, (resolution,) * 3)], axis=1)


def released_style(field: JointField, points: Float[ndarray, "n 3"], threads: int) -> None:
    """The plain network at points, 5,000 at a time."""
    with torch.no_grad(), machine(threads, "default", keep_memory=False):
        for start, end in pairwise([*range(0, len(points), CHUNK), len(points)]):
            field.trunk(torch.from_numpy(points[start:end]))


def assert_same(sparse: Surface, dense: Surface) -> None:
    """Check that both paths give one mesh."""
    assert np.array_equal(sparse.faces, dense.faces), "sparse and dense give different faces"
    assert np.allclose(sparse.vertices, dense.vertices, atol=1e-6), "sparse and dense give different vertices"


def in_a_new_process(function: Callable[[int, int], list[Row]], *arguments: int) -> list[Row]:
    """Call a function whose peak memory counts where nothing was allocated before."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        return pool.submit(function, *arguments).result()


@freed_memory_kept()
def thin_plate(resolution: int, steps: int) -> list[Row]:
    """Seconds and memory of a fine grid on a plate, a hundredth of its length thick."""
    box = trimesh.creation.box(extents=PLATE)
    mesh = LabelledMesh(np.array(box.vertices), np.array(box.faces), np.zeros(len(box.faces), dtype=np.int64))
    _, module = fitted(composed(f"trainer.max_steps={steps}"), mesh)
    reset_peak_memory()
    (seconds,) = interleaved(1, lambda: Extraction(resolution).surface(module.field.network_sdf), warm_up=False)
    memory, whole = peak_memory_mb() / 1024, resolution == 1024
    name = f"sparse extraction, {resolution}^3, thin plate"
    return [
        Row(name, "allowed seconds", seconds, SECONDS, "s", seconds / SECONDS, 1.0 if whole else None, at_least=False),
        Row(name, "allowed memory", memory, GIB, "GiB", memory / GIB, 1.0 if whole else None, at_least=False),
    ]


def octree_rows(fields: Mapping[str, int] = FITTED, repetitions: int = 2, overrides: Sequence[str] = ()) -> list[Row]:
    """Ours against libigl's octree on fitted fields; those of ABC shapes where their meshes are.

    Args:
        fields: Grid points along each axis, by shape.
        repetitions: Of every side.
        overrides: Of the configs.
    """
    root = os.environ.get("JOINTSDF_ABC", "")
    there = [name for name in fields if name not in abc.catalogue() or (root and abc.mesh_path(name, root).is_file())]
    found = []
    for shape in there:
        cfg = composed(f"shape={shape}", *overrides)
        _, module = fitted(cfg)
        with machine(torch.get_num_threads(), measured(cfg, module).matmul):
            found += beside_octree(shape, module.field, fields[shape], repetitions)
    return found


def beside_octree(shape: str, field: JointField, resolution: int, repetitions: int) -> list[Row]:
    """Seconds, points, vertices and open edges of one field's mesh, by every way; measuring the slope takes no time."""
    extraction, slope = Extraction(resolution), slope_bound(field)
    surfaces: dict[str, Surface] = {}

    def grid() -> Grid:
        return Grid(field.network_sdf, resolution, extraction.chunk)

    ways: dict[str, Callable[[], Surface]] = {
        "ours": lambda: extraction.surface(field.network_sdf),
        "libigl at slope 1": lambda: libigl_mesh(grid(), 1.0),
        f"libigl at slope {slope:.2f}": lambda: libigl_mesh(grid(), slope),
        "its octree at slope 1, then followed": lambda: followed_mesh(grid(), 1.0),
    }
    sides = [lambda name=name, way=way: surfaces.update({name: way()}) for name, way in ways.items()]
    seconds = dict(zip(ways, interleaved(repetitions, *sides, warm_up=False), strict=True))
    what = f"sparse extraction, {resolution}^3, {shape}"
    found = []
    for against in list(ways)[1:]:
        ours, theirs = seconds["ours"], seconds[against]
        found.append(Row(what, against, ours, theirs, "s", theirs / ours))
        found += compared(what, against, surfaces["ours"], surfaces[against], resolution)
    return found


def compared(what: str, against: str, ours: Surface, theirs: Surface, resolution: int) -> list[Row]:
    """Points asked of the field, our vertices that they have as well, and edges of one face only: rims of holes."""
    points, their_points = (surface.evaluated * resolution**3 for surface in (ours, theirs))
    apart, _ = KDTree(theirs.vertices).query(ours.vertices, distance_upper_bound=SAME)
    vertices, shared = len(ours.vertices), int((apart < SAME).sum())
    (rims, _), (their_rims, edges) = rim_edges(ours), rim_edges(theirs)
    return [
        Row(what, f"{against}: points", points, their_points, "points", their_points / points),
        Row(what, f"{against}: vertices in both", vertices, shared, "vertices", shared / max(vertices, 1)),
        Row(what, f"{against}: rim edges, share", rims, their_rims, "edges", their_rims / max(edges, 1)),
    ]


def rim_edges(surface: Surface) -> tuple[int, int]:
    """Number of edges with one face only, and of all edges."""
    _, faces = np.unique(edge_keys(surface.faces, len(surface.vertices)), return_counts=True)
    return int((faces == 1).sum()), len(faces)
