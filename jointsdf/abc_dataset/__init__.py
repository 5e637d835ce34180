"""The catalogue's ABC shapes, from what ABC distributes: files, archives, or a download.

Every finished step leaves a whole file under its final name and is never done twice: archives and the members taken
out of them in `ROOT/source`, shapes in `ROOT/<name>`.
"""

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from jointsdf.abc_dataset import archive, chunks, convert, members
from jointsdf.abc_dataset.progress import Progress, silent
from jointsdf.errors import InputError
from jointsdf.shapes import abc

DONE, THERE, ABSENT, FAILED = "done", "already there", "not in this source", "failed"
FORMATS = {"obj": ("obj", "feat"), "step": ("step",), "obj without features": ("obj",), "stl": ("stl",)}

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Outcome:
    """What became of one shape.

    Attributes:
        name: Catalogue name.
        status: DONE, THERE, ABSENT or FAILED.
        detail: What was made, or why nothing was.
    """

    name: str
    status: str
    detail: str


def source_folder(root: Path) -> Path:
    """Where archives and their members are kept."""
    return root / "source"


def is_prepared(name: str, root: Path) -> bool:
    """Whether the shape's mesh is there; it is written last, so all of it is."""
    return abc.mesh_path(name, root).is_file()


def prepare(
    names: Sequence[str],
    root: Path,
    sources: Sequence[Path],
    *,
    preferred: str = "obj",
    progress: Progress = silent,
) -> Iterator[Outcome]:
    """Prepare shapes from local files, one outcome each as soon as it is known.

    Args:
        names: Catalogue names.
        root: The folder that gets one folder per shape.
        sources: Folders, searched with all that is below, of ABC files and of archives named as ABC names them; or
            7z files. `ROOT/source` is always one.
        preferred: The format that is used where a model is there in several, a key of FORMATS.
        progress: Shows how far an archive is read.

    Raises:
        InputError: A source is missing, or an archive is damaged or hostile. What was finished before stays.
    """
    for name in names:
        if is_prepared(name, root):
            yield Outcome(name, THERE, str(abc.mesh_path(name, root)))
    todo = [abc.catalogue()[name] for name in names if not is_prepared(name, root)]
    folders = [*(each for each in sources if each.suffix.lower() != ".7z"), source_folder(root)]
    archives = members.archives([*sources, source_folder(root)]) if todo else []
    index = members.index(folders) if todo else {}
    for wanted in dict.fromkeys([preferred, *FORMATS]):
        for kind in FORMATS[wanted]:
            _extract(todo, kind, archives, index, root, progress)
        found = {entry: [members.find(index, entry, kind) for kind in FORMATS[wanted]] for entry in todo}
        for entry, files in found.items():
            paths = [path for path in files if path is not None]
            if len(paths) == len(files):
                todo.remove(entry)
                yield _converted(entry, paths, root)
    for entry in todo:
        yield Outcome(entry.name, ABSENT, f"no step, obj or stl of ABC model {entry.abc_id}")


def _extract(
    todo: Sequence[abc.CatalogueEntry],
    kind: str,
    archives: Sequence[members.Archive],
    index: members.Index,
    root: Path,
    progress: Progress,
) -> None:
    """Take the members of one kind that are still missing out of the archives that may hold them."""
    for each in archives:
        missing = [
            entry
            for entry in todo
            if each.chunk in (None, chunks.chunk_of(entry.abc_id)) and members.find(index, entry, kind) is None
        ]
        if missing and each.kind in (None, kind):

            def is_wanted(name: str, missing: Sequence[abc.CatalogueEntry] = missing) -> bool:
                member = members.parsed(name)
                return member is not None and member.kind == kind and any(map(member.belongs_to, missing))

            for path in archive.extract(each.path, is_wanted, source_folder(root), progress):
                members.add(index, path)


def _converted(entry: abc.CatalogueEntry, paths: Sequence[Path], root: Path) -> Outcome:
    """Write one shape; what is wrong with its files is its own outcome, the others go on."""
    try:
        return Outcome(entry.name, DONE, convert.write(entry, paths, root / entry.name))
    except InputError as error:
        return Outcome(entry.name, FAILED, str(error))
