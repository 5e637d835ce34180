"""Preparation of the catalogue's ABC shapes from ABC's files and archives.

Every finished step leaves a whole file under its final name and is never repeated: archives and the members extracted
from them in `ROOT/source`, shapes in `ROOT/<name>`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from jointsdf.abc_dataset import archive, chunks, convert, members
from jointsdf.abc_dataset.progress import Progress, silent
from jointsdf.errors import InputError
from jointsdf.shapes import abc

DONE, THERE, ABSENT, FAILED = "done", "already there", "not in this source", "failed"
FORMATS = {  # the kinds of file that make one shape
    "obj": ("obj", "feat"),
    "step": ("step",),
    "obj without features": ("obj",),
    "stl": ("stl",),
}


@dataclass(frozen=True)
class Outcome:
    """Result of the preparation of one shape.

    Attributes:
        name: Catalogue name.
        status: DONE, THERE, ABSENT or FAILED.
        detail: Summary of the files written, or the reason why there are none.
    """

    name: str
    status: str
    detail: str


def source_folder(root: Path) -> Path:
    """Folder of the archives and of the members extracted from them."""
    return root / "source"


def is_prepared(name: str, root: Path) -> bool:
    """True if the shape's mesh exists; it is written last, so the shape is complete."""
    return abc.mesh_path(name, root).is_file()


def prepare(
    names: Sequence[str],
    root: Path,
    sources: Sequence[Path],
    *,
    preferred: str = "obj",
    progress: Progress = silent,
) -> Iterator[Outcome]:
    """Prepare shapes from local files, and yield the outcome of each as soon as it is known.

    Args:
        names: Catalogue names.
        root: The folder that gets one folder per shape.
        sources: Folders of ABC files and of archives under ABC's names, searched recursively; or 7z files.
            `ROOT/source` is always searched.
        preferred: Format to use where a model exists in several, a key of FORMATS.
        progress: Shows how far an archive is read.

    Raises:
        InputError: A source is missing, or an archive is damaged or hostile. Finished shapes stay.
    """
    for name in names:
        if is_prepared(name, root):
            yield Outcome(name, THERE, str(abc.mesh_path(name, root)))
    todo = [abc.catalogue()[name] for name in names if not is_prepared(name, root)]
    if not todo:
        return
    folders = [*(each for each in sources if each.suffix.lower() != ".7z"), source_folder(root)]
    archives = members.find_archives([*sources, source_folder(root)])
    index = members.index_files(folders)
    for wanted in dict.fromkeys([preferred, *FORMATS]):
        for kind in FORMATS[wanted]:
            _extract_missing(todo, kind, archives, index, root, progress)
        found = {entry: [members.find_file(index, entry, kind) for kind in FORMATS[wanted]] for entry in todo}
        for entry, files in found.items():
            paths = [path for path in files if path is not None]
            if len(paths) == len(files):
                todo.remove(entry)
                yield _convert(entry, paths, root)
    for entry in todo:
        yield Outcome(entry.name, ABSENT, f"no step, obj or stl of ABC model {entry.abc_id}")


def _extract_missing(
    todo: Sequence[abc.CatalogueEntry],
    kind: str,
    archives: Sequence[members.Archive],
    index: members.Index,
    root: Path,
    progress: Progress,
) -> None:
    """Extract the members of one kind that are still missing from the archives that may hold them."""
    for each in archives:
        missing = [
            entry
            for entry in todo
            if each.chunk in (None, chunks.chunk_of(entry.abc_id)) and members.find_file(index, entry, kind) is None
        ]
        if missing and each.kind in (None, kind):

            def is_wanted(name: str, missing: Sequence[abc.CatalogueEntry] = missing) -> bool:
                member = members.parse_name(name)
                return member is not None and member.kind == kind and any(map(member.belongs_to, missing))

            for path in archive.extract(each.path, is_wanted, source_folder(root), progress):
                members.add_file(index, path)


def _convert(entry: abc.CatalogueEntry, paths: Sequence[Path], root: Path) -> Outcome:
    """Write one shape; damaged files make it fail without stopping the others."""
    try:
        return Outcome(entry.name, DONE, convert.write_shape(entry, paths, root / entry.name))
    except InputError as error:
        return Outcome(entry.name, FAILED, str(error))
