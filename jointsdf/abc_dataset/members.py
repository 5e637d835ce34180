"""Names of files and archives in the ABC dataset, and searches by them."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from jointsdf.errors import InputError
from jointsdf.shapes.abc import CatalogueEntry

MEMBER = re.compile(r"(\d{8})_([0-9a-f]{24})_(trimesh|features|step)_(\d+)\.(obj|stl|yml|step|stp)")
KINDS = {
    ("trimesh", "obj"): "obj",
    ("trimesh", "stl"): "stl",
    ("features", "yml"): "feat",
    ("step", "step"): "step",
    ("step", "stp"): "step",
}
ARCHIVE = re.compile(r"abc_(\d{4})_(obj|feat|step|stl2)_v\d+\.7z")

Index = dict[tuple[str, str], list[Path]]


@dataclass(frozen=True)
class Member:
    """The contents of a file, by its name.

    Attributes:
        model: ABC's number of the model, 8 digits.
        document: 24 hexadecimal digits.
        kind: `obj`, `stl`, `feat` or `step`.
    """

    model: str
    document: str
    kind: str

    def belongs_to(self, entry: CatalogueEntry) -> bool:
        """True if it belongs to the catalogue entry's model; some entries know the number alone."""
        known = re.match(r"\d{8}_([0-9a-f]{24})", entry.abc_id)
        return self.model == entry.abc_id[:8] and (known is None or known[1] == self.document)


@dataclass(frozen=True)
class Archive:
    """A 7z file that may hold members.

    Attributes:
        path: The file.
        kind: Of its members, None where the name does not say.
        chunk: Its number, None where the name does not say.
    """

    path: Path
    kind: str | None
    chunk: str | None


def parse_name(name: str) -> Member | None:
    """Parse a file name, with or without folders; None if it is no ABC file that is used here.

    >>> parse_name("00000007/00000007_b33a147f86da49879455d286_trimesh_000.obj").kind
    'obj'
    """
    found = MEMBER.fullmatch(re.split(r"[\\/]", name)[-1])
    kind = KINDS.get((found[3], found[5])) if found else None
    return Member(found[1], found[2], kind) if found and kind else None


def index_files(folders: Sequence[Path]) -> Index:
    """Find the ABC files in folders, recursively, by model and kind."""
    files: Index = {}
    for folder in folders:
        for path in sorted(folder.rglob("*_*_*_*.*")):
            add_file(files, path)
    return files


def add_file(files: Index, path: Path) -> None:
    """Add one file, if it is an ABC file by its name."""
    member = parse_name(path.name)
    if member and path.is_file():
        files.setdefault((member.model, member.kind), []).append(path)


def find_file(files: Index, entry: CatalogueEntry, kind: str) -> Path | None:
    """Find the file of one kind of a catalogue entry's model."""
    for path in files.get((entry.abc_id[:8], kind), []):
        member = parse_name(path.name)
        if member and member.belongs_to(entry):
            return path
    return None


def find_archives(sources: Sequence[Path]) -> list[Archive]:
    """List the 7z files among the sources, and those under ABC's names in folders, recursively."""
    paths = []
    for source in sources:
        inside = source.rglob("*.7z") if source.is_dir() else []
        paths += [source] if source.is_file() else sorted(path for path in inside if ARCHIVE.fullmatch(path.name))
    found = ((path, ARCHIVE.fullmatch(path.name)) for path in dict.fromkeys(paths))
    return [
        Archive(path, named[2].replace("stl2", "stl"), named[1]) if named else Archive(path, None, None)
        for path, named in found
    ]


def check_sources(sources: Sequence[Path]) -> None:
    """Refuse what cannot be a source.

    Raises:
        InputError: One is missing, or a file but no 7z archive.
    """
    for source in sources:
        if not source.exists():
            raise InputError(f"--from {source} does not exist: give a folder of ABC files, or a 7z archive")
        if source.is_file() and source.suffix.lower() != ".7z":
            raise InputError(f"--from {source} is neither a folder nor a 7z archive: give the folder that holds it")
