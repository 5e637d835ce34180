"""Patterns of files, `my_parts/*.stl`, in folders whose own names may look like patterns. Imports no torch."""

import glob
import os
from collections.abc import Iterator
from pathlib import Path


def matching_files(pattern: str) -> Iterator[str]:
    """Find what matches a pattern of the shell (`*`, `?`, `[ab]`, and `**` for any depth), hidden files left out.

    Args:
        pattern: Its leading folders that exist are meant as they are called, `parts [v2]` and all.

    Yields:
        Files and folders, in no order; nothing for a name without a pattern.
    """
    if not glob.has_magic(pattern):
        return
    path = Path(pattern)
    folder = next((parent for parent in path.parents if parent.is_dir()), Path())
    yield from glob.iglob(os.path.join(glob.escape(str(folder)), path.relative_to(folder)), recursive=True)
