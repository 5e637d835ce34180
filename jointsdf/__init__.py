"""Neural signed distance fields that know their parts: one shared SIREN trunk, one segmentation head, one CAD shape.

Public functions: `load_shape`, `fit` and `load_field`. They are imported on first use, so that `import jointsdf` is
fast and changes no setting of the process.
"""

from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

from jointsdf.moved_names import install

if TYPE_CHECKING:
    from jointsdf.api import FittedRun, fit, load_field, load_shape
    from jointsdf.errors import InputError

__all__ = ["FittedRun", "InputError", "__version__", "fit", "load_field", "load_shape"]
MODULES = {"FittedRun": "api", "fit": "api", "load_field": "api", "load_shape": "api", "InputError": "errors"}

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
