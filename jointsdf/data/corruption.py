"""Corruptions of a training cloud, as those of real scans: noise, gaps, outliers, uneven density, wrong labels.

They are applied to the cloud before anything is estimated from it, in this order: scanner, density, missing, count,
outliers, noise (of all points but the outliers), wrong labels. Each has a random stream of its own, keyed by the seed.
Lengths are shares of the longest side of the surface that is scanned. Nothing of them reaches the ground truth.
"""

from dataclasses import asdict, dataclass, field, replace

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.data.scanner import Scanner
from jointsdf.data.streams import CLOUD, COUNT, DENSITY, FLIPS, MISSING, NOISE, OUTLIERS, PLACES, RAYS, stream
from jointsdf.data.surface_points import SurfacePoints, bounding_box, draw_enough
from jointsdf.errors import InputError, require_integer, require_number
from jointsdf.geometry.mesh import face_areas, face_normals
from jointsdf.geometry.sampling import sample_by_area
from jointsdf.values import BOX, UNLABELLED, LabelledMesh

LEAST_COUNT = 100  # points that a corrupted cloud must have left
STEEPEST = 1e4  # ratio of densities


@dataclass(frozen=True)
class Corruption:
    """What a training cloud suffers; by default nothing.

    Attributes:
        scanner: Takes the place of uniform sampling.
        density: Largest density of points over the smallest: it falls exponentially along the longest side of the box.
        missing: Share of the points that lie in a cap, cut off by a plane of random direction, and are removed.
        count: So many points are kept, at random; None for all.
        outliers: Share of the points that are moved to uniform places in a cube about the box, and get random labels.
        noise: Standard deviation of the isotropic Gaussian that moves every coordinate of every point.
        label_flip: Share of the labelled points that get the label of another part.

    Raises:
        InputError: A value out of its range.
    """

    scanner: Scanner = field(default_factory=Scanner)
    density: float = 1.0
    missing: float = 0.0
    count: int | None = None
    outliers: float = 0.0
    noise: float = 0.0
    label_flip: float = 0.0

    def __post_init__(self) -> None:
        """Check the ranges."""
        require_number("data.corruption.density", self.density, 1, STEEPEST)
        for name in ("missing", "outliers", "label_flip"):
            require_number(f"data.corruption.{name}", getattr(self, name), 0, 0.9)
        require_number("data.corruption.noise", self.noise, 0, 1)
        if self.count is not None:
            require_integer("data.corruption.count", self.count, LEAST_COUNT)

    def __str__(self) -> str:
        """The settings that corrupt, e.g. `missing=0.1 noise=0.005`; "" for none."""
        given, usual = asdict(self), asdict(Corruption())
        scanner, unused = given.pop("scanner"), usual.pop("scanner")
        shown = {f"scanner.{name}": value for name, value in scanner.items() if value != unused[name] and self.scans}
        shown |= {name: value for name, value in given.items() if value != usual[name]}
        return " ".join(f"{name}={value:g}" for name, value in shown.items())

    @property
    def scans(self) -> bool:
        """True if the scanner takes the place of uniform sampling."""
        return self.scanner.views > 0

    def scan_mesh(self, mesh: LabelledMesh, count: int, seed: int) -> SurfacePoints:
        """Draw points of a mesh by scanner and density, and corrupt them.

        Args:
            mesh: Ground truth, file frame. It is not changed.
            count: Points to draw; `missing` and `count` leave fewer. Without scanner and with even density they are
                those of the clean cloud.
            seed: Of the run.

        Raises:
            InputError: The scanner sees next to nothing of the mesh, or too few points are left.
        """
        normals, areas = face_normals(mesh.vertices, mesh.faces), face_areas(mesh)
        box = bounding_box(mesh.vertices[mesh.faces].reshape(-1, 3))

        def draw(number: int) -> SurfacePoints:
            if self.scans:
                points, faces = self.scanner.scan(mesh, count, stream(seed, PLACES), stream(seed, RAYS, number))
            else:
                points, faces = sample_by_area(mesh.vertices, mesh.faces, areas, count, stream(seed, CLOUD, number))
            return self._thin(SurfacePoints(points, normals[faces], mesh.labels[faces]), box, seed, number)

        return self._spoil(draw_enough(draw, count), box, mesh.part_ids, seed)

    def corrupt(self, surface: SurfacePoints, seed: int) -> SurfacePoints:
        """Corrupt the points of a cloud that is the shape itself: density thins it.

        Args:
            surface: The points.
            seed: Of the run.

        Raises:
            InputError: A scanner is wanted, which needs a mesh, or too few points are left.
        """
        if self.scans:
            raise InputError(
                f"data.corruption.scanner.views={self.scanner.views}: it scans a mesh, and the shape is a cloud: "
                "give the mesh as shape=, or leave it out"
            )
        box = bounding_box(surface.points)
        parts = np.unique(surface.labels[surface.labels != UNLABELLED])
        return self._spoil(self._thin(surface, box, seed), box, parts, seed)

    def _thin(self, surface: SurfacePoints, box: Float[ndarray, "2 3"], seed: int, number: int = 0) -> SurfacePoints:
        """Keep points with a probability that falls exponentially along the longest side of the box."""
        if self.density == 1:
            return surface
        axis = int(np.argmax(box[1] - box[0]))
        along = (surface.points[:, axis] - box[0, axis]) / (box[1, axis] - box[0, axis])
        return surface.take(stream(seed, DENSITY, number).random(len(surface)) < self.density**-along)

    def _spoil(
        self, surface: SurfacePoints, box: Float[ndarray, "2 3"], parts: Int[ndarray, " k"], seed: int
    ) -> SurfacePoints:
        """Apply all but scanner and density."""
        if self.missing:
            direction = stream(seed, MISSING).standard_normal(3)
            order = np.argsort(surface.points @ direction, kind="stable")
            surface = surface.take(np.sort(order[: len(order) - round(len(order) * self.missing)]))
        if self.count is not None and self.count < len(surface):
            surface = surface.take(np.sort(stream(seed, COUNT).permutation(len(surface))[: self.count]))
        if len(surface) < LEAST_COUNT:
            raise InputError(
                f"data.corruption ({self}) leaves {len(surface)} points: at least {LEAST_COUNT} are needed"
            )
        strays = choose_share(np.arange(len(surface)), self.outliers, seed, OUTLIERS)
        surface = move_away(surface, strays, box, parts, seed)
        if self.noise:
            offsets = stream(seed, NOISE).normal(0, self.noise * (box[1] - box[0]).max(), surface.points.shape)
            offsets[strays] = 0
            surface = replace(surface, points=surface.points + offsets)
        return replace(surface, labels=flip_labels(surface.labels, self.label_flip, parts, seed))


def choose_share(among: Int[ndarray, " n"], share: float, seed: int, purpose: int) -> Int[ndarray, " m"]:
    """Choose a share of some indices at random, rounded to a whole number of them."""
    return stream(seed, purpose).permutation(among)[: round(len(among) * share)]


def move_away(
    surface: SurfacePoints, strays: Int[ndarray, " m"], box: Float[ndarray, "2 3"], parts: Int[ndarray, " k"], seed: int
) -> SurfacePoints:
    """Move points to uniform places in the cube about the box, 1.1 times its longest side, with labels of any part."""
    if not len(strays):
        return surface
    generator = stream(seed, OUTLIERS, 1)
    points, normals, labels = surface.points.copy(), surface.normals.copy(), surface.labels.copy()
    half = BOX * (box[1] - box[0]).max() / 2
    points[strays] = box.mean(axis=0) + generator.uniform(-half, half, (len(strays), 3))
    normals[strays] = 0
    if len(parts):
        labels[strays] = generator.choice(parts, len(strays))
    return SurfacePoints(points, normals, labels)


def flip_labels(labels: Int[ndarray, " n"], share: float, parts: Int[ndarray, " k"], seed: int) -> Int[ndarray, " n"]:
    """Give a share of the labelled points the label of another part, any of them alike; with one part there is none.

    >>> flip_labels(np.array([3, 3, 5, -1]), 0.7, np.array([3, 5]), 0).tolist().count(-1)
    1
    """
    chosen = choose_share(np.flatnonzero(labels != UNLABELLED), share, seed, FLIPS)
    if not len(chosen) or len(parts) < 2:
        return labels
    places = np.searchsorted(parts, labels[chosen])
    places += stream(seed, FLIPS, 1).integers(1, len(parts), len(chosen))
    flipped = labels.copy()
    flipped[chosen] = parts[places % len(parts)]
    return flipped
