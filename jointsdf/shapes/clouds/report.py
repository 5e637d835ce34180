"""Report on a point cloud before the fit: count, spacing, noise, density, outliers, gaps, labels."""

import logging
import math
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import KDTree

from jointsdf.geometry.cloud_statistics import LINK, NEIGHBOUR, count_rims, estimate_noise, mark_outliers
from jointsdf.values import UNLABELLED, Scan, Unit

MOST, ASKED = 100_000, 2000  # points that the report looks at, and at which noise is estimated
RANGE = (5, 95)  # percentiles of the density
OF_UNIFORM = 3.3  # ratio of these percentiles for uniform random points: of a gamma distribution with the shape 8
LISTED = 24  # parts on the screen
NOISY, STRAY = 0.001, 0.001  # noise (of the longest side) and share of outliers from which a warning is given

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class CloudReport:
    """One cloud in numbers; lengths in file units.

    Attributes:
        name: Of the scan.
        points: Number of points.
        side: Longest side of their bounding box.
        spacing: Median distance to the nearest other point.
        noise: Estimated standard deviation of the points about their surface.
        density: Ratio of the density that 95% of the points are below to the one that 5% are; 3.3 for uniform points.
        outliers: Share of points that are alone.
        rims: Number of rims of what the points do not cover.
        rim_points: Number of points at them.
        with_normals: Share of the points with a normal of the file.
        labelled: Share of the points with a label.
        parts: Each part's id and share of the labelled points, largest first.
        unit: Of the file.
        wall: Thickness of the thinnest wall, which points do not tell: infinite.
        widths: Widths of the parts, which they do not tell either: none.
    """

    name: str
    points: int
    side: float
    spacing: float
    noise: float
    density: float
    outliers: float
    rims: int
    rim_points: int
    with_normals: float
    labelled: float
    parts: tuple[tuple[int, float], ...]
    unit: Unit
    wall: float = math.inf
    widths: dict[int, float] = field(default_factory=dict)

    def lines(self) -> list[str]:
        """The report as text, at most a screen."""
        unit = f"unit {self.unit.name}" + ("" if self.unit.known else " (assumed; unit=in says otherwise)")
        shown = [f"{part}: {share:.1%}" for part, share in self.parts[:LISTED]]
        more = [f"and {len(self.parts) - LISTED} more"] if len(self.parts) > LISTED else []
        gaps = f"{self.rims} regions, rims of {self.rim_points} points" if self.rims else "none found"
        return [
            f"{self.name}: {self.points} points, longest side {self.side:.4g}, {unit}",
            f"  spacing       {self.spacing:.3g} {self.unit.name} ({self.spacing / self.side:.2%} of the longest side)",
            f"  noise         {self.noise:.2g} {self.unit.name} ({self.noise / self.side:.3%})",
            f"  density       1 to {self.density:.1f} (5% and 95% of the points; {OF_UNIFORM} if uniform)",
            f"  outliers      {self.outliers:.2%} of the points",
            f"  uncovered     {gaps}",
            f"  normals       of {self.with_normals:.0%} of the points",
            f"  labels        of {self.labelled:.0%} of the points, {len(self.parts)} parts"
            + (f" ({', '.join(shown + more)})" if self.parts else ""),
        ]

    def warnings(self) -> list[str]:
        """What the fit will not bear well, one line each."""
        found = []
        if self.noise > NOISY * self.side:
            found.append(
                f"{self.name}: noise of {self.noise / self.side:.2%} of the longest side: what is finer is not there"
            )
        if self.outliers > STRAY:
            found.append(f"{self.name}: {self.outliers:.2%} of the points are alone: the fit may put surface there")
        return found

    def log(self, cell: float) -> None:  # noqa: ARG002
        """Log the lines and the warnings; the argument is that of a mesh's report."""
        for line in self.lines():
            logger.info(line)
        for line in self.warnings():
            logger.warning(line)

    def counts(self) -> dict[str, int]:
        """Whole numbers for a result row."""
        return {"points_gt": self.points, "rims_gt": self.rims}

    def facts(self) -> dict[str, float | bool | str]:
        """Other facts for a result row."""
        return {
            "spacing": self.spacing / self.side,
            "noise": self.noise / self.side,
            "outliers": self.outliers,
            "labelled": self.labelled,
            "unit": self.unit.name,
            "unit_known": self.unit.known,
        }


def cloud_report(scan: Scan) -> CloudReport:
    """Measure a cloud in the file frame. Of a large one, points are chosen at random, the same in every run."""
    generator = np.random.default_rng(0)
    count = len(scan.points)
    chosen = np.sort(generator.choice(count, MOST, replace=False)) if count > MOST else np.arange(count)
    points = scan.points[chosen]
    thinned = math.sqrt(len(points) / count)  # distances on a surface grow by the root of the points left out
    tree = KDTree(points)
    distances = tree.query(points, [2, NEIGHBOUR + 1], workers=-1)[0]
    strays = mark_outliers(distances[:, 1])
    near, far = np.percentile(distances[~strays, 1] ** 2, RANGE)
    reach = LINK * float(np.median(distances[:, 1]))
    rims, rim_points = count_rims(points[~strays], KDTree(points[~strays]), reach)
    asked = generator.choice(len(points), min(ASKED, len(points)), replace=False)
    ids, of_parts = np.unique(scan.labels[scan.labels != UNLABELLED], return_counts=True)
    order = np.argsort(-of_parts, kind="stable")
    return CloudReport(
        scan.name,
        count,
        scan.side,
        float(np.median(distances[:, 0])) * thinned,
        estimate_noise(points, asked, tree),
        float(far / max(near, np.finfo(float).tiny)),
        float(strays.mean()),
        rims,
        rim_points,
        float(scan.normals.any(axis=1).mean()),
        float((scan.labels != UNLABELLED).mean()),
        tuple((int(ids[k]), float(of_parts[k] / of_parts.sum())) for k in order),
        scan.unit,
    )
