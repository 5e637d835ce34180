"""PartField's output for a bar, imitated: its files' names, shapes, ids and frame, with faces in another order."""

from pathlib import Path

import numpy as np
import trimesh

from jointsdf import shapes
from jointsdf.values import Shape

BAR = trimesh.creation.box((12, 2, 2), transform=trimesh.transformations.translation_matrix((30, 4, 1)))
BAR = BAR.subdivide().subdivide().subdivide()
SECTION = np.digitize(BAR.triangles_center[:, 0], [25.5, 31.5, 33.0])  # lengths 1.5, 6, 1.5 and 3; two have a cap
BY_AREA = np.array([2, 0, 3, 1])[SECTION]
ORDER = np.random.default_rng(3).permutation(len(BAR.faces))
TREE_IDS = np.array([5000, 17, 812, 30])


def in_partfields_frame(mesh: trimesh.Trimesh, order: np.ndarray) -> trimesh.Trimesh:
    vertices = np.random.default_rng(1).permutation(len(mesh.vertices))
    back = np.argsort(vertices)
    low, high = mesh.bounds
    placed = (mesh.vertices - (low + high) / 2) * (1.8 / (high - low).max())
    return trimesh.Trimesh(placed[vertices].astype(np.float32), back[mesh.faces[order]], process=False)


def write_output(
    folder: Path, name: str, *, mesh: bool = True, features: bool = True, counts: tuple[int, ...] = ()
) -> None:
    (folder / "cluster_out").mkdir(parents=True, exist_ok=True)
    if mesh:
        in_partfields_frame(BAR, ORDER).export(folder / f"input_{name}_0.ply")
    if features:
        noise = np.random.default_rng(2).normal(0, 0.02, (len(ORDER), 16))
        vectors = (np.eye(16)[SECTION] + noise) * np.random.default_rng(4).uniform(0.1, 9, (len(ORDER), 1))
        np.save(folder / f"part_feat_{name}_0_batch.npy", vectors[ORDER].astype(np.float32))
    for count in counts:
        ids = TREE_IDS[np.minimum(SECTION, count - 1)][ORDER]
        as_kmeans = count % 2 == 0
        stored = ids.astype(np.float32)[:, None] if as_kmeans else ids
        np.save(folder / "cluster_out" / f"{name}_0_{count:02d}.npy", stored)


def load(path: Path, folder: Path | None, **options: object) -> Shape:
    return shapes.load(str(path), labels="partfield", partfield_dir=folder, abc_root="nowhere", **options)
