"""Files of a folder, or of a pattern such as `my_parts/*.stl`, that are shapes: the values of `shapes=`."""

import glob
import logging
import os
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

from jointsdf.errors import InputError
from jointsdf.experiment.quoting import check_characters
from jointsdf.shapes.labels.beside import OF_FOLDER, possible_label_files
from jointsdf.shapes.readers.formats import FORMATS, LISTED, format_of

log = logging.getLogger(__name__)

SHOWN = 4  # names in a line; of more, their number


def list_part_files(given: str | Sequence[str]) -> list[Path]:
    """List the mesh and STEP files of folders and patterns, sorted by name within each; no file twice.

    Hidden files and label files of other files are no shapes. What else is passed over is logged.

    Args:
        given: Folders, patterns with `*` or `**`, or files; one, or several.

    Raises:
        InputError: One of them is missing, or has no shapes. One line, with the fix.
    """
    names = [given] if isinstance(given, str) else given
    found = dict.fromkeys(path for name in names for path in _files_of(str(name)))
    return [path for path in found if _has_usable_name(path)]


def _files_of(name: str) -> list[Path]:
    path = Path(name).expanduser()
    if path.is_dir():
        return _files_in(path)
    if os.path.lexists(path):
        return [path]
    matching = [Path(match) for match in sorted(glob.glob(_pattern(path), recursive=True))]
    if shapes := _without_labels(match for match in matching if _is_shape(match)):
        return shapes
    what = "nothing there is a shape" if matching else "no such folder or file"
    raise InputError(f"shapes={name}: {what}; give a folder of mesh files, or a pattern in quotes, 'my_parts/*.stl'")


def _pattern(path: Path) -> str:
    """The path as a pattern, in which existing folders are meant as they are called, `[v2]` and all."""
    folder = next(parent for parent in path.parents if parent.is_dir() or parent == parent.parent or parent == Path())
    return os.path.join(glob.escape(str(folder)), path.relative_to(folder))


def _files_in(folder: Path) -> list[Path]:
    try:
        entries = sorted(path for path in folder.iterdir() if not path.name.startswith("."))
        deeper = [path.name for path in entries if path.is_dir() and any(map(_is_shape, path.iterdir()))]
    except OSError as error:
        raise InputError(f"{folder} cannot be read: {error.strerror}") from error
    shapes = _without_labels(path for path in entries if _is_shape(path))
    advice = f"shapes='{folder}/**/*.{shapes[0].suffix.lstrip('.') if shapes else FORMATS[0]}' takes them"
    below = f"shapes in {_shorten(deeper)} below it are passed over; {advice}"
    if not shapes:
        formats = f"no file there is a shape ({LISTED})"
        raise InputError(f"{folder}: {below if deeper else f'{formats}; give another folder'}")
    if deeper:
        log.warning("%s: %s", folder, below)
    if len(shapes) > 1 and (folder / OF_FOLDER).is_file():
        log.warning("%s: its %s counts for each part without <part>.labels.npy of its own", folder, OF_FOLDER)
    labels = {path for shape in shapes for path in possible_label_files(shape)}
    others = [path for path in entries if path.is_file() and path not in labels and path not in shapes]
    if kinds := Counter(path.suffix.lower() or path.name for path in others if path.name != OF_FOLDER):
        log.info("%s: %d shapes; files of other kinds are left: %s", folder, len(shapes), _shorten(list(kinds)))
    return shapes


def _is_shape(path: Path) -> bool:
    """Whether a file is a shape by its name; a broken link is one that fails."""
    known = bool(format_of(path)) and not path.name.startswith(".")
    return known and (path.is_file() or path.is_symlink()) and not path.is_dir()


def _without_labels(paths: Iterable[Path]) -> list[Path]:
    shapes = list(paths)
    labels = {path for shape in shapes for path in possible_label_files(shape)}
    return [path for path in shapes if path not in labels]


def _has_usable_name(path: Path) -> bool:
    try:
        check_characters(str(path))
    except InputError as error:
        log.error("passed over: %s", error)
        return False
    return True


def _shorten(names: Sequence[str]) -> str:
    rest = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + rest
