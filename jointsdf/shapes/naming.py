"""Names of shapes: those of the catalogues, and those of mesh files in rows and folders."""

import re
import unicodedata
from pathlib import Path

from jointsdf.shapes import abc, builtin
from jointsdf.shapes.readers.formats import stem_of
from jointsdf.shapes.readers.mesh_file import content_sha256
from jointsdf.user_paths import expand_home

FALLBACK = "part_01"  # in place of an ABC mesh that is not on this machine
LONGEST_STEM, LONGEST_BYTES = 100, 200  # characters, and their bytes in UTF-8: file systems allow names of 255
HASH_DIGITS = 6  # of the sha256 in the name of a mesh file


def shape_names() -> list[str]:
    """Every name that `load` accepts: the built-in parts, then the ABC catalogue."""
    return [*builtin.part_names(), *abc.catalogue()]


def name_of(shape: str, *, abc_root: str | Path, abc_missing: str) -> str:
    """The name that rows and folders give a shape, without loading it: its own, or a mesh file's stem and content.

    Args:
        shape: As for `load`; need not exist.
        abc_root: As for `load`.
        abc_missing: As for `load`.

    >>> name_of("part_07", abc_root="data/abc", abc_missing="fallback")
    'part_07'
    """
    if shape in abc.catalogue():
        fallback = abc_missing == "fallback" and not abc.mesh_path(shape, abc_root).is_file()
        return FALLBACK if fallback else shape
    path = Path(expand_home(shape))
    if shape in builtin.BUILTINS or not path.is_file():
        return _safe_stem(path)
    try:
        return name_of_file(path, content_sha256(path, path.read_bytes()))
    except OSError:  # reported by whoever loads it
        return _safe_stem(path)


def name_of_file(path: Path, sha256: str) -> str:
    """Name of a mesh file's shape, safe for folders: letters and digits of any script are kept, in Unicode's form NFC.

    Args:
        path: The mesh file.
        sha256: Of its content.

    >>> name_of_file(Path("parts/my part (v2).stl"), "d98d1d94a8")
    'my_part__v2_-d98d1d'
    >>> name_of_file(Path("Gehäuse.stl"), "d98d1d94a8")
    'Gehäuse-d98d1d'
    """
    return f"{_safe_stem(path)}-{sha256[:HASH_DIGITS]}"


def _safe_stem(path: Path) -> str:
    name = re.sub(r"[^\w.-]", "_", unicodedata.normalize("NFC", stem_of(path))).lstrip(".")[:LONGEST_STEM]
    return name.encode()[:LONGEST_BYTES].decode(errors="ignore") or "mesh"
