"""Module names of before, which stored configs, scripts and people's fingers still use, as aliases of those of now."""

import importlib
import importlib.abc
import importlib.util
import sys
from importlib.machinery import ModuleSpec
from types import ModuleType

MOVED = {  # what is below a name has moved with it
    "jointsdf.field": "jointsdf.model.field",
    "jointsdf.figures": "jointsdf.study.figures",
    "jointsdf.heads": "jointsdf.model.heads",
    "jointsdf.results": "jointsdf.runs.row",
    "jointsdf.shapes.abc.__main__": "jointsdf.abc_dataset.__main__",
    "jointsdf.sweep": "jointsdf.experiment.sweep",
}


class MovedNames(importlib.abc.MetaPathFinder):
    """Finds a module under the name that it had before: `jointsdf.field` is the very module `jointsdf.model.field`."""

    def find_spec(
        self,
        fullname: str,
        path: object,  # noqa: ARG002 (Python's signature)
        target: ModuleType | None = None,  # noqa: ARG002
    ) -> ModuleSpec | None:
        """The alias, where the name is one."""
        new = _name_of_now(fullname)
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
    """Hands out the module of another name."""

    def __init__(self, name: str) -> None:
        self.name = name

    def create_module(self, spec: ModuleSpec) -> ModuleType:  # noqa: ARG002 (Python's signature)
        """The module of now."""
        module = importlib.import_module(self.name)
        self.spec = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Nothing to run: only its own spec is put back, which the import system has replaced."""
        module.__spec__ = self.spec


def _name_of_now(fullname: str) -> str | None:
    for old, new in MOVED.items():
        if fullname == old or fullname.startswith(f"{old}."):
            return new + fullname[len(old) :]
    return None


def install() -> None:
    """Have the names of before imported; once is enough."""
    if not any(isinstance(finder, MovedNames) for finder in sys.meta_path):
        sys.meta_path.insert(0, MovedNames())
