"""Files of a folder, or of a pattern such as `my_parts/*.stl`, that are shapes: the values of `shapes=`."""

import logging
import os
from collections.abc import Sequence
from pathlib import Path

from jointsdf.errors import InputError
from jointsdf.experiment.file_patterns import matching_files
from jointsdf.experiment.quoting import check_characters
from jointsdf.shapes.labels.beside import OF_FOLDER, possible_label_files
from jointsdf.shapes.readers.formats import LISTED, POINTS, format_of, suffix_of, unread_by_name
from jointsdf.user_paths import expand_home

log = logging.getLogger(__name__)

SHOWN = 4  # names in a line; of more, their number


def list_part_files(given: str | Sequence[str]) -> list[Path]:
    """List the mesh and STEP files of folders and patterns, sorted by name within each; no file twice.

    Hidden files and label files of other files are no shapes. What else is passed over is logged.

    Args:
        given: Folders, patterns with `*` or `**`, or files; one, or several.

    Raises:
        InputError: One of them is missing, or none has shapes. One line, with the fix.
    """
    names = [given] if isinstance(given, str) else given
    files = list(dict.fromkeys(path for name in names for path in _files_of(str(name))))
    shapes = [path for path in files if _may_be_shape(path)]
    labels = {path for shape in shapes for path in possible_label_files(shape)}
    _log_others([path for path in files if path not in shapes and path not in labels and path.name != OF_FOLDER])
    usable = [path for path in shapes if path not in labels and _has_usable_name(path)]
    if not usable:
        asked = f"shapes={given}" if isinstance(given, str) else ", ".join(names[:SHOWN])
        raise InputError(f"{asked}: no file there is a shape ({LISTED}); give a folder of them, or 'my_parts/**'")
    for folder in {path.parent for path in usable if (path.parent / OF_FOLDER).is_file()}:
        if sum(path.parent == folder for path in usable) > 1:
            log.warning("%s: its %s counts for each part without <part>.labels.npy of its own", folder, OF_FOLDER)
    return usable


def _may_be_shape(path: Path) -> bool:
    return bool(format_of(path)) or suffix_of(path) in POINTS


def _files_of(name: str) -> list[Path]:
    path = Path(expand_home(name))
    if path.is_dir():
        return _files_in(path)
    matching = [path] if os.path.lexists(path) else sorted(map(Path, matching_files(str(path))))
    if not matching:
        fix = "give a folder of mesh files, or a pattern in quotes, 'my_parts/*.stl'"
        raise InputError(f"shapes={name}: no such folder or file; {fix}")
    return [path for path in matching if not path.is_dir()]


def _files_in(folder: Path) -> list[Path]:
    """Files of a folder, among them broken links, which fail as shapes; shapes below it are named."""
    try:
        entries = sorted(path for path in folder.iterdir() if not path.name.startswith("."))
    except OSError as error:
        raise InputError(f"{folder} cannot be read: {error.strerror}; give a folder that can") from error
    folders = [path for path in entries if path.is_dir()]
    deeper = [path.name for path in folders if any(map(format_of, map(Path, matching_files(f"{path}/*"))))]
    if deeper:
        fix = f"shapes='{folder}/**' takes them"
        log.warning("%s: shapes in %s below it are passed over; %s", folder, _shorten(deeper), fix)
    return [path for path in entries if path not in set(folders)]


def _log_others(files: Sequence[Path]) -> None:
    """Name files that are not read: those of CAD systems and the like with what to do, of others their kinds."""
    fixable: dict[str, list[str]] = {}
    others: dict[str, None] = {}
    for path in files:
        unread = unread_by_name(path)
        if unread and not unread.fix.startswith("give "):  # another file, since this one can never be a shape
            fixable.setdefault(f"{unread.name}: {unread.fix}", []).append(str(path))
        else:
            others[path.suffix.lower() or path.name] = None
    for what, names in fixable.items():
        log.warning("passed over: %s: %s", _shorten(names), what)
    if others:
        log.info("files of other kinds are left: %s", _shorten(list(others)))


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
