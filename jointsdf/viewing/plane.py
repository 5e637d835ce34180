"""The plane of a slice: normal to an axis of the file frame, chosen by the outline that it cuts from a mesh."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
import trimesh
from jaxtyping import Bool, Float
from numpy import ndarray
from trimesh.intersections import mesh_multiplane

from jointsdf.errors import InputError
from jointsdf.geometry.mesh import face_areas, face_normals
from jointsdf.values import BOX, LabelledMesh, Normalisation, Unit

AXES = "xyz"
CANDIDATES = 15  # planes normal to each axis; odd, so that one is in the middle
SIMILAR = 0.9  # of the longest outline: of planes with so much, the most central one is taken
BESIDE, PARALLEL = 0.03, 0.99  # of the mesh's extent along the normal; cosine: faces that a plane runs along
BLOCKED = 0.01  # of the squared longest side: area of such faces from which a plane is avoided
DIGITS = 3  # of a plane's place, relative to the mesh's extent along the normal
FLAT = 1e-6  # of the longest side: least extent for these digits
FACES = 50_000  # of larger meshes every second, third, ... face is looked at


@runtime_checkable
class Raster(Protocol):
    """A square of a plane with coordinates of its own."""

    def ticks(self, count: int) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
        """Coordinates of a raster's columns and rows."""
        ...


@dataclass(frozen=True)
class Plane:
    """A plane normal to an axis, and the square of the training box in it; file frame.

    Attributes:
        normal: Index of the axis.
        place: Coordinate along it.
        right: Axis to the right in the picture.
        up: Axis upwards in the picture.
        low: Lower left corner of the square, along `right` and `up`.
        side: Of the square.
    """

    normal: int
    place: float
    right: int
    up: int
    low: Float[ndarray, "2"]
    side: float

    @classmethod
    def at(cls, normal: int, place: float, normalisation: Normalisation, up: str = "z") -> "Plane":
        """The plane normal to an axis at a coordinate along it.

        Args:
            normal: Index of the axis.
            place: File units.
            normalisation: File frame -> network frame.
            up: Axis of the file frame that points up, also in the picture where it lies in the plane.
        """
        right, upwards = sorted({0, 1, 2} - {normal}, key=lambda axis: (AXES[axis] == up, axis))
        corner = normalisation.inverse(np.full((1, 3), -BOX))[0, [right, upwards]]
        return cls(normal, place, right, upwards, corner, 2 * BOX * normalisation.scale)

    @property
    def name(self) -> str:
        """Its equation, without the unit.

        >>> Plane(1, 12.5, 0, 2, np.zeros(2), 1.0).name
        'y = 12.5'
        """
        return f"{AXES[self.normal]} = {self.place:.10g}"

    def ticks(self, count: int) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
        """Coordinates of a raster's columns and rows: the middles of `count` equal intervals of the square's sides."""
        middles = (np.arange(count) + 0.5) / count * self.side
        return self.low[0] + middles, self.low[1] + middles

    def raster(self, count: int) -> Float[ndarray, "n 3"]:
        """Points of a raster of `count` rows and columns, row by row upwards, each from left to right."""
        columns, rows = self.ticks(count)
        points = np.zeros((count, count, 3))
        points[..., self.normal], points[..., self.right], points[..., self.up] = self.place, columns, rows[:, None]
        return points.reshape(-1, 3)


@dataclass(frozen=True)
class Slice:
    """Signed distances in a plane, on a raster whose rows go upwards; file units, negative inside.

    Attributes:
        plane: The plane, and the square of the training box in it.
        truth: Exact distance of the ground truth.
        fit: The fitted field.
        size: Longest side of the ground truth.
        unit: Of the file frame.
    """

    plane: Plane
    truth: Float[ndarray, "n n"]
    fit: Float[ndarray, "n n"]
    size: float
    unit: Unit


def parse_plane(
    text: str, normalisation: Normalisation, up: str, *, option: str = "--at", examples: str = "e.g. --at y=12.5"
) -> Plane:
    """Make the plane of an equation.

    Args:
        text: E.g. `y=12.5`, file units.
        normalisation: File frame -> network frame.
        up: Axis of the file frame that points up.
        option: Of the command line, for messages.
        examples: The same.

    Raises:
        InputError: Not such an equation, or a plane outside the training box.
    """
    name, _, number = text.replace(" ", "").partition("=")
    try:
        normal, place = AXES.index(name), float(number)
    except ValueError as error:
        raise InputError(f"{option} {text}: give an axis and a coordinate in file units, {examples}") from error
    low, high = normalisation.inverse(np.array([[-BOX] * 3, [BOX] * 3]))[:, normal]
    if not low <= place <= high:
        raise InputError(f"{option} {text}: outside the training box; give {name} from {low:.6g} to {high:.6g}")
    return Plane.at(normal, place, normalisation, up)


def choose_plane(mesh: LabelledMesh, normalisation: Normalisation, up: str = "z") -> Plane:
    """Choose the plane that cuts the longest outline from the mesh, or nearly so and through its middle.

    `CANDIDATES` planes normal to each axis are spread evenly over the mesh. Those that run along faces are avoided: all
    their distances are to these. Of the planes with 0.9 of the longest outline, the most central one is taken, and of
    equally central ones that of the longest outline.

    Args:
        mesh: Not empty, file frame.
        normalisation: File frame -> network frame.
        up: Axis of the file frame that points up.
    """
    corners = mesh.vertices[mesh.faces].reshape(-1, 3)
    low, extents = corners.min(axis=0), np.ptp(corners, axis=0)
    shares = (np.arange(CANDIDATES) + 0.5) / CANDIDATES
    decimals = DIGITS - np.floor(np.log10(np.maximum(extents, FLAT * extents.max()))).astype(int)
    places = np.stack([(low[k] + shares * extents[k]).round(decimals[k]) for k in range(3)])
    outlines = _outlines(mesh, places)
    if (free := outlines * ~_along_faces(mesh, places)).any():
        outlines = free
    similar = outlines >= SIMILAR * outlines.max()
    off_middle = np.broadcast_to(np.abs(2 * np.arange(CANDIDATES) - CANDIDATES + 1), outlines.shape)
    best = np.lexsort((-outlines.ravel(), off_middle.ravel(), ~similar.ravel()))[0]
    return Plane.at(int(best) // CANDIDATES, float(places.ravel()[best]), normalisation, up)


def _outlines(mesh: LabelledMesh, places: Float[ndarray, "3 c"]) -> Float[ndarray, "3 c"]:
    """Length of the curves in which planes cut the mesh, by a row of places normal to each axis."""
    every = -(-len(mesh.faces) // FACES)
    surface = trimesh.Trimesh(mesh.vertices, mesh.faces[::every], process=False)
    lengths = np.zeros(places.shape)
    for axis, normal in enumerate(np.eye(3)):
        cuts, _, _ = mesh_multiplane(surface, np.zeros(3), normal, places[axis])
        lengths[axis] = [every * np.linalg.norm(cut[:, 1] - cut[:, 0], axis=1).sum() for cut in cuts]
    return lengths


def _along_faces(mesh: LabelledMesh, places: Float[ndarray, "3 c"]) -> Bool[ndarray, "3 c"]:
    """Whether planes run along faces of considerable area."""
    corners, normals, areas = mesh.vertices[mesh.faces], face_normals(mesh.vertices, mesh.faces), face_areas(mesh)
    extents = np.ptp(corners.reshape(-1, 3), axis=0)
    covered = np.zeros(places.shape)
    for axis in range(3):
        parallel = np.abs(normals[:, axis]) > PARALLEL
        apart = np.abs(corners[parallel, :, axis].mean(axis=1) - places[axis][:, None])
        covered[axis] = (apart < BESIDE * extents[axis]) @ areas[parallel]
    return covered > BLOCKED * extents.max() ** 2
