"""Aliases for former module names that stored configs and scripts still use."""

import importlib
import importlib.abc
import importlib.util
import sys
from importlib.machinery import ModuleSpec
from types import ModuleType

MOVED = {  # former name -> module; submodules included
    "jointsdf.field": "jointsdf.model.field",
    "jointsdf.figures": "jointsdf.study.figures",
    "jointsdf.heads": "jointsdf.model.heads",
    "jointsdf.results": "jointsdf.runs.row",
    "jointsdf.shapes.abc.__main__": "jointsdf.abc_dataset.__main__",
    "jointsdf.sweep": "jointsdf.experiment.sweep",
}


class MovedNames(importlib.abc.MetaPathFinder):
    """Finds a module under its former name: `jointsdf.field` is the module object `jointsdf.model.field` itself."""

    def find_spec(
        self,
        fullname: str,
        path: object,  # noqa: ARG002 (Python's signature)
        target: ModuleType | None = None,  # noqa: ARG002
    ) -> ModuleSpec | None:
        """Spec of the alias; None for a name that is none."""
        new = current_name(fullname)
        if new is None:
            return None
        spec = importlib.util.find_spec(new)
        if spec is None:
            return None
        if new.endswith(".__main__"):  # a command: Python reads its code from the file
            return importlib.util.spec_from_file_location(fullname, spec.origin)
        alias = ModuleSpec(fullname, _Alias(new), is_package=spec.submodule_search_locations is not None)
        alias.submodule_search_locations = spec.submodule_search_locations
        return alias


class _Alias(importlib.abc.Loader):
    """Loads the module of another name."""

    def __init__(self, name: str) -> None:
        self.name = name

    def create_module(self, spec: ModuleSpec) -> ModuleType:  # noqa: ARG002 (Python's signature)
        """Import the module under its current name."""
        module = importlib.import_module(self.name)
        self.spec = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Restore the module's own spec, which the import system has replaced; there is nothing to execute."""
        module.__spec__ = self.spec


def current_name(fullname: str) -> str | None:
    """The name of today of something in a moved module; None where it has not moved.

    >>> current_name("jointsdf.heads.siren.SirenHead")
    'jointsdf.model.heads.siren.SirenHead'
    """
    for old, new in MOVED.items():
        if fullname == old or fullname.startswith(f"{old}."):
            return new + fullname[len(old) :]
    return None


def install() -> None:
    """Add the finder to the import system, once."""
    if not any(isinstance(finder, MovedNames) for finder in sys.meta_path):
        sys.meta_path.insert(0, MovedNames())
