"""The libraries of the extra `peers`, imported when they are needed: a missing one is a mistake of one line."""

import ctypes
import importlib
from types import ModuleType

from jointsdf.errors import InputError, first_line

INSTALL = 'make peers, or pip install "jointsdf[peers]"'


def open3d() -> ModuleType:
    """Open3D, errors alone on the screen. Where the system has no libusb, which it links, that of `libusb-package`."""
    try:
        library = importlib.import_module("open3d")
    except ImportError:
        _preload_libusb()
        library = _imported("open3d")
    library.utility.set_verbosity_level(library.utility.VerbosityLevel.Error)
    return library


def pymeshlab() -> ModuleType:
    """MeshLab's filters."""
    return _imported("pymeshlab")


def maxflow() -> ModuleType:
    """Minimum cuts (Boykov and Kolmogorov)."""
    return _imported("maxflow")


def _imported(name: str) -> ModuleType:
    """The module.

    Raises:
        InputError: It is not installed, or a library of the system that it links is not there.
    """
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        raise InputError(f"{name} is not installed ({first_line(error)}): {INSTALL}") from error
    except (ImportError, OSError) as error:
        packages = "apt install libgl1 libusb-1.0-0 libgomp1"
        raise InputError(f"{name} cannot be loaded ({first_line(error)}): install that library, {packages}") from error


def _preload_libusb() -> None:
    """Load libusb for the libraries that link it by name; nothing happens where the package is not there either."""
    try:
        path = importlib.import_module("libusb_package").get_library_path()
        ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL)
    except (ImportError, OSError):
        return
