"""Report on a ground-truth mesh before the fit: repairs, near contacts, buried faces, thinnest wall, parts."""

import logging
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.geometry.mesh import face_areas, face_normals, part_areas
from jointsdf.geometry.part_widths import part_widths
from jointsdf.geometry.rays import ray_lengths
from jointsdf.geometry.sampling import sample_by_area
from jointsdf.geometry.topology import count_cavities, count_components
from jointsdf.geometry.winding import WindingNumber
from jointsdf.values import LabelledMesh, Shape, Unit

SAMPLES, WINDINGS = 10000, 2000  # points on the surface for rays, and for winding numbers
CONTACT = 1e-4  # of the longest side: faces nearer than that may touch
LIFT = 2e-6  # of starts of rays and of winding points off the surface, of the longest side
WITHIN = 0.4  # winding number on the outer side of a face above which it is buried: a sheet inside a solid has 0.5
THINNEST = 0.01  # share of the surface whose walls are as thin as the thinnest one, or thinner
SUSPECT = 0.001  # share of points from which a warning is given; fewer are edges and corners
LISTED = 24  # parts on the screen

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class MeshReport:
    """One mesh in numbers; lengths in file units.

    Attributes:
        name: Of the shape.
        faces: Number of faces.
        components: Number of connected components; faces that share a vertex are connected.
        cavities: Number of those that are wound inward, in a watertight mesh.
        watertight: Whether the faces close a volume.
        flipped: Number of faces whose winding was reversed.
        dropped: Number of faces left out: repeated, doubled, or without area.
        welded: Number of vertices moved to another one, nearly at the same place.
        contacts: Share of the surface nearer than 1e-4 of the longest side to another face, inward or outward.
        buried: Share of the surface that lies inside the solid: bodies overlap or touch, or there are faces within.
        unit: Of the file.
        wall: Thickness that 1% of the surface's walls are below; infinite where no ray meets a wall.
        parts: Each part's id and share of the area, largest first.
        widths: Of each part (`geometry/part_widths.py`), by its id.
    """

    name: str
    faces: int
    components: int
    cavities: int
    watertight: bool
    flipped: int
    dropped: int
    welded: int
    contacts: float
    buried: float
    unit: Unit
    wall: float
    parts: tuple[tuple[int, float], ...]
    widths: dict[int, float]

    def lines(self, cell: float) -> list[str]:
        """The report as text, at most a screen.

        Args:
            cell: Edge of a cell of the extraction grid, file units.
        """
        pieces = "1 component" if self.components == 1 else f"{self.components} components"
        if self.cavities:
            pieces += f" ({self.cavities} {'a cavity' if self.cavities == 1 else 'cavities'})"
        repairs = f"{self.flipped} faces flipped, {self.dropped} dropped, {self.welded} vertices welded"
        shown = [f"{part}: {share:.1%}" for part, share in self.parts[:LISTED]]
        more = [f"and {len(self.parts) - LISTED} more"] if len(self.parts) > LISTED else []
        cells = (
            f"{self.wall:.4g} {self.unit.name}, {self.wall / cell:.1f} cells of the grid (1% of the walls are thinner)"
        )
        closed = "watertight" if self.watertight else "not watertight"
        unit = f"unit {self.unit.name}" + ("" if self.unit.known else " (assumed; unit=in says otherwise)")
        return [
            f"{self.name}: {self.faces} faces, {pieces}, {closed}, {unit}",
            f"  repairs       {repairs if self.flipped or self.dropped or self.welded else 'none'}",
            f"  near contact  {self.contacts:.2%} of the surface, inside the solid {self.buried:.2%}",
            f"  thinnest wall {cells if np.isfinite(self.wall) else 'none met'}",
            f"  parts         {len(self.parts)}" + (f" ({', '.join(shown + more)})" if self.parts else ""),
        ]

    def warnings(self) -> list[str]:
        """Places that the fit will not represent well, one line each."""
        found = []
        if self.buried > SUSPECT:
            found.append(
                f"{self.name}: {self.buried:.1%} of the surface lies inside the solid (bodies that overlap or touch, "
                "or faces within): the field cannot show it, unite the bodies in the CAD program"
            )
        if self.contacts > SUSPECT:
            found.append(
                f"{self.name}: {self.contacts:.1%} of the surface nearly touches another face: the field will join or "
                "open such places"
            )
        return found

    def log(self, cell: float) -> None:
        """Log the lines and the warnings; the argument is that of `lines`."""
        for line in self.lines(cell):
            logger.info(line)
        for line in self.warnings():
            logger.warning(line)

    def counts(self) -> dict[str, int]:
        """Whole numbers for a result row."""
        return {"components_gt": self.components, "flipped_gt": self.flipped, "dropped_gt": self.dropped}

    def facts(self) -> dict[str, float | bool | str]:
        """Other facts for a result row."""
        return {
            "watertight": self.watertight,
            "near_contact": round(self.contacts, 5),
            "inside_solid": round(self.buried, 5),
            "thinnest_wall": self.wall,
            "unit": self.unit.name,
            "unit_known": self.unit.known,
        }


def mesh_report(shape: Shape) -> MeshReport:
    """Measure a shape in the file frame. The sample points are the same in every run."""
    mesh = shape.mesh
    areas, of_parts = face_areas(mesh), part_areas(mesh)
    order = np.argsort(-of_parts, kind="stable")
    vertices, size = _to_unit_box(mesh)
    corners = vertices[mesh.faces]
    points, faces = sample_by_area(vertices, mesh.faces, areas, SAMPLES, np.random.default_rng(0))
    normals = face_normals(vertices, mesh.faces)[faces]
    inward, outward = _clearance(corners, points, -normals), _clearance(corners, points, normals)
    near = (inward < CONTACT) | (outward < CONTACT)
    wall = float(np.quantile(inward, THINNEST, method="lower")) * size
    return MeshReport(
        shape.name,
        len(mesh.faces),
        count_components(mesh.faces),
        count_cavities(mesh.vertices, mesh.faces) if shape.watertight else 0,
        shape.watertight,
        shape.flipped,
        shape.dropped,
        shape.welded,
        float(near.mean()),
        _buried(vertices, mesh.faces, points, normals),
        shape.unit,
        wall,
        tuple((int(mesh.part_ids[part]), float(of_parts[part] / areas.sum())) for part in order),
        dict(zip(mesh.part_ids.tolist(), part_widths(mesh).tolist(), strict=True)),
    )


def _to_unit_box(mesh: LabelledMesh) -> tuple[Float[ndarray, "v 3"], float]:
    """Move the middle of the box to the origin and scale its longest side to 1; also that side, mesh units."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    size = float((high - low).max())
    return (mesh.vertices - (low + high) / 2) / size, size


def _clearance(
    corners: Float[ndarray, "f 3 3"], points: Float[ndarray, "n 3"], directions: Float[ndarray, "n 3"]
) -> Float[ndarray, " n"]:
    """Distance along rays from the surface to the next face, infinite without one. Longest sides."""
    return ray_lengths(corners, points + LIFT * directions, directions) + LIFT


def _buried(
    vertices: Float[ndarray, "v 3"],
    faces: Int[ndarray, "f 3"],
    points: Float[ndarray, "n 3"],
    normals: Float[ndarray, "n 3"],
) -> float:
    """Share of the points whose outer side is inside the solid, by the winding number."""
    return float((WindingNumber(vertices, faces).at((points + LIFT * normals)[:WINDINGS]) > WITHIN).mean())
