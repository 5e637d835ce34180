"""Catalogue of 50 real CAD shapes of the ABC dataset (Koch et al., CVPR 2019): facts only, without the meshes."""

import csv
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path

from jointsdf.user_paths import expand_home


@dataclass(frozen=True)
class CatalogueEntry:
    """One row of the catalogue table.

    Attributes:
        name: Catalogue name, `abc_0001` .. `abc_0050`.
        abc_id: The model's id in the ABC dataset.
        source: Public repository and path of the mesh.
        sha256: Of the mesh file's bytes.
        patches: Number of B-rep patches, 0 where none are known.
        geometry: Derivation of the mesh from what ABC distributes.
        extents: Sides of the mesh's bounding box, in the mesh file's units.
    """

    name: str
    abc_id: str
    source: str
    sha256: str
    patches: int
    geometry: str
    extents: tuple[float, ...]


@cache
def catalogue() -> dict[str, CatalogueEntry]:
    """Every catalogue shape by name, in the table's order."""
    table = resources.files("jointsdf.shapes").joinpath("abc.csv").read_text(encoding="utf-8")
    return {
        row["name"]: CatalogueEntry(
            name=row["name"],
            abc_id=row["abc_id"],
            source=f"{row['source_repository']}/{row['source_path']}",
            sha256=row["sha256"],
            patches=int(row["patches"]),
            geometry=row["geometry"],
            extents=tuple(float(side) for side in row["extents"].split()),
        )
        for row in csv.DictReader(table.splitlines())
    }


def mesh_path(name: str, root: str | Path) -> Path:
    """Path of the mesh of a catalogue shape, existing or not.

    Args:
        name: Catalogue name.
        root: The folder that holds one folder per shape.
    """
    return Path(expand_home(str(root))) / name / "mesh.ply"


def how_to_get(entry: CatalogueEntry, path: Path) -> str:
    """Message for the user, one line: the path without the mesh, and the ways to get it."""
    return (
        f"{entry.name} is not on this machine (looked for {path}); make abc prepares it, or set paths.abc_root or the "
        f"environment variable JOINTSDF_ABC to a folder that holds {entry.name}/mesh.ply (ABC model {entry.abc_id}, "
        f"from {entry.source})"
    )
