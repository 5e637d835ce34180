"""Neural signed distance fields that know their parts: one shared SIREN trunk, one segmentation head, one CAD shape.

Public functions: `load_shape`, `load_cloud`, `fit`, `load_field` and `export_field`. They are imported on first use, so
that `import jointsdf` is fast and changes no setting of the process.
"""

from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

from jointsdf.moved_names import install

if TYPE_CHECKING:
    from jointsdf.api import FittedRun, fit, load_field, load_shape
    from jointsdf.errors import InputError
    from jointsdf.export.export import export_field
    from jointsdf.shapes.clouds.sources import load_cloud

__all__ = ["FittedRun", "InputError", "__version__", "export_field", "fit", "load_cloud", "load_field", "load_shape"]
MODULES = {
    **dict.fromkeys(("FittedRun", "fit", "load_field", "load_shape"), "api"),
    "InputError": "errors",
    "export_field": "export.export",
    "load_cloud": "shapes.clouds.sources",
}

try:
    __version__ = version("jointsdf")
except PackageNotFoundError:  # run from a checkout that is not installed
    __version__ = "unknown"

install()


def __getattr__(name: str) -> Any:
    """Import a public name on first use (PEP 562)."""
    if name not in MODULES:
        raise AttributeError(f"module 'jointsdf' has no attribute {name!r}")
    return getattr(import_module(f"jointsdf.{MODULES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
