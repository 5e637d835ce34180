"""Training cloud of a shape, and the pool of points at which its signed distance is taken."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.spatial import KDTree

from jointsdf.data.streams import BORDERS, CLOUD, CREASES, LABELS, PARTS, POOL, REGIONS, stream
from jointsdf.geometry.face_graph import face_graph, smooth_regions
from jointsdf.geometry.mesh import face_areas, face_normals
from jointsdf.geometry.sampling import sample_beside_creases, sample_by_area, sample_near_borders, sample_parts
from jointsdf.values import BOX, UNLABELLED, LabelledMesh, Normalisation

POOL_SCALES = (-3.0, -1.0)  # log10 of the narrowest and widest near-surface noise of the pool, network length units
JUDGES = 10000  # about so many points, of all parts together, judge the labels of a refit


@dataclass(frozen=True)
class Cloud:
    """Training cloud: the points of the surface that a run trains on.

    Attributes:
        points: In the network frame: `uniform` of them uniform by area, then `regional` spread over the smooth regions,
            `creased` beside creases, `of_parts` as many of every part as of any other, the others near part borders.
        normals: Unit normals of the points' faces, or estimated from the points; 0 where they are unknown.
        labels: Class index 0..K-1, -1 where unlabelled.
        part_ids: Original id of each class, ascending.
        normalisation: File frame -> network frame: the cloud's mean, and its largest |coordinate| about it.
        uniform: Number of points uniform by area.
        regional: Number of points spread over the smooth regions, so that small regions have their share.
        creased: Number of points beside creases.
        of_parts: Number of points drawn part by part, so that the smallest part has as many as the largest.
    """

    points: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]
    labels: Int[ndarray, " n"]
    part_ids: Int[ndarray, " k"]
    normalisation: Normalisation
    uniform: int
    regional: int = 0
    creased: int = 0
    of_parts: int = 0

    @property
    def part_points(self) -> slice:
        """The points drawn part by part."""
        first = self.uniform + self.regional + self.creased
        return slice(first, first + self.of_parts)

    @property
    def border_points(self) -> slice:
        """The points near part borders."""
        return slice(self.part_points.stop, len(self.points))

    @classmethod
    def of(
        cls,
        mesh: LabelledMesh,
        *,
        count: int,
        seed: int,
        label_fraction: float = 1.0,
        region_points: int = 0,
        crease_points: int = 0,
        part_points: int = 0,
        border_points: int = 0,
    ) -> "Cloud":
        """Draw the cloud of a ground-truth mesh.

        Args:
            mesh: Ground truth, file frame.
            count: Points uniform by area.
            seed: Of the run.
            label_fraction: Share of the points that keep their label.
            region_points: Points spread over the smooth regions, beyond `count`.
            crease_points: Points beside creases, beyond `count`; none where the mesh has no crease, and fewer where it
                is thin.
            part_points: Points drawn part by part, beyond `count`: so many over all, at least one of every part; none
                where no face has a label.
            border_points: Points near part borders, beyond `count`; none where the mesh has no border.
        """
        areas = face_areas(mesh)
        points, faces = sample_by_area(mesh.vertices, mesh.faces, areas, count, stream(seed, CLOUD))
        drawn = [(points, faces)]
        if region_points:
            shares = areas / np.sqrt(region_areas(mesh, areas))
            drawn.append(sample_by_area(mesh.vertices, mesh.faces, shares, region_points, stream(seed, REGIONS)))
        beside = sample_beside_creases(mesh, crease_points, stream(seed, CREASES))
        of_parts = sample_parts(mesh, part_points, stream(seed, PARTS))
        drawn += [beside, of_parts]
        if border_points:
            drawn.append(sample_near_borders(mesh, border_points, stream(seed, BORDERS)))
        points, faces = (np.concatenate(parts) for parts in zip(*drawn, strict=True))
        normals = face_normals(mesh.vertices, mesh.faces)[faces]
        sizes = {"uniform": count, "regional": region_points, "creased": len(beside[0]), "of_parts": len(of_parts[0])}
        return cls.of_points(
            points, normals, mesh.labels[faces], mesh.part_ids, seed=seed, label_fraction=label_fraction, **sizes
        )

    @classmethod
    def of_points(
        cls,
        points: Float[ndarray, "n 3"],
        normals: Float[ndarray, "n 3"],
        labels: Int[ndarray, " n"],
        part_ids: Int[ndarray, " k"],
        *,
        seed: int,
        label_fraction: float = 1.0,
        **sizes: int,
    ) -> "Cloud":
        """Make the cloud of points in the file frame.

        Args:
            points: Positions; `uniform` of them come first.
            normals: Their unit normals, 0 where unknown.
            labels: Their original part ids, -1 where unlabelled.
            part_ids: All original part ids, ascending.
            seed: Of the run.
            label_fraction: Share of the points that keep their label.
            **sizes: `uniform` (all points without it), `regional`, `creased`, `of_parts`.
        """
        sizes = {"uniform": len(points), **sizes}
        centre = points[: sizes["uniform"]].mean(axis=0)
        normalisation = Normalisation(centre, float(np.abs(points[: sizes["uniform"]] - centre).max()))
        classes = np.where(labels == UNLABELLED, UNLABELLED, np.searchsorted(part_ids, labels))
        dropped = stream(seed, LABELS).permutation(len(points))[round(len(points) * label_fraction) :]
        classes[dropped] = UNLABELLED
        return cls(normalisation.forward(points), normals, classes, part_ids, normalisation, **sizes)

    def without(self, left_out: Bool[ndarray, " m"]) -> "Cloud":
        """The cloud without some of its uniform points.

        Args:
            left_out: Marks of the uniform points.
        """
        kept = np.concatenate([~left_out, np.ones(len(self.points) - self.uniform, dtype=bool)])
        arrays = {name: getattr(self, name)[kept] for name in ("points", "normals", "labels")}
        return replace(self, **arrays, uniform=int((~left_out).sum()))

    def judging(self) -> Int[ndarray, " m"]:
        """Indices of points from which no labels are learned, about as many of every part: these judge others."""
        of_parts = np.arange(len(self.points))[self.part_points]
        stride = self.of_parts // JUDGES
        chosen: Int[ndarray, " m"] = of_parts[1::stride] if stride > 1 else of_parts[:0]
        return chosen

    def relative_area(self) -> float:
        """Area of the surface in squares of half its longest side, estimated from the uniform points alone.

        On a plane with point density rho the squared distance to the nearest point has the mean 1 / (pi rho), as in
        Clark and Evans (1954). Too small where walls and gaps are thinner than that distance.
        """
        points = self.points[: self.uniform]
        nearest = KDTree(points).query(points, [2], workers=-1)[0]
        return float(len(points) * np.pi * (nearest**2).mean() / (np.ptp(points, axis=0).max() / 2) ** 2)


def region_areas(mesh: LabelledMesh, areas: Float[ndarray, " f"]) -> Float[ndarray, " f"]:
    """Area of the smooth region that each face belongs to, in the unit of `areas`."""
    regions = smooth_regions(face_graph(mesh), None)
    return np.asarray(np.bincount(regions, areas)[regions])


def draw_pool(cloud: Cloud, *, count: int, near_share: float, seed: int) -> Float[ndarray, "n 3"]:
    """Draw points at which distances are taken, network frame: a share near the surface, the rest in the whole box.

    Near points are Gaussian about cloud points, not those beside creases and part borders, with a log-uniform width, so
    that every wall thickness is met. Half of the rest is uniform, half has arcsine-distributed coordinates, so that the
    corners of the box are met as well.

    Args:
        cloud: The training cloud.
        count: Number of points.
        near_share: Share of them near the surface, 0..1.
        seed: Of the run.
    """
    generator = stream(seed, POOL)
    near = round(count * near_share)
    widths = 10 ** generator.uniform(*POOL_SCALES, (near, 1))
    around = cloud.points[generator.integers(cloud.uniform + cloud.regional, size=near)]
    near_points = np.clip(around + widths * generator.standard_normal((near, 3)), -BOX, BOX)
    anywhere = generator.uniform(-1, 1, (count - near, 3))
    anywhere[::2] = np.sin(np.pi / 2 * anywhere[::2])
    return np.concatenate([near_points, BOX * anywhere])
