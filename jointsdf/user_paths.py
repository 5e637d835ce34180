"""Paths as a user types them."""

import os


def expand_home(name: str) -> str:
    """Expand `~` at the start of a path (POSIX tilde expansion), unless a file or folder has that very name.

    Args:
        name: As typed; `~part.stl` may be a file, or begin with a user's name.

    >>> expand_home("parts/~old.stl")
    'parts/~old.stl'
    """
    return name if os.path.lexists(name) else os.path.expanduser(name)
