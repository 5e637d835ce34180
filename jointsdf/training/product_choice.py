"""Choice of the fit's matrix products: as configured, from the checkpoint, from the cache file, or by trials now.

A choice holds for one machine and one set of sizes. It is stored, so that the bits of a fit do not depend on the
machine's load at one moment.
"""

import hashlib
import json
import logging
import os
from collections.abc import Mapping
from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import torch
from platformdirs import user_cache_path

from jointsdf.errors import InputError
from jointsdf.runs.files import write_atomically
from jointsdf.runs.provenance import cpu_model, cpu_vendor
from jointsdf.threads import large_pieces, workers
from jointsdf.training.matrix_products import CHOICES, Products, Sizes, use_matmul
from jointsdf.training.product_trials import Trial, choose_by_trials, emulates_bfloat16, trials_of_sizes

RESTRICTED_BY = ("ATEN_CPU_CAPABILITY", "ONEDNN_MAX_CPU_ISA", "MKL_ENABLE_INSTRUCTIONS")  # instructions left out

log = logging.getLogger(__name__)


def set_products(wanted: Products, sizes: Sizes, stored: Mapping[str, Any] | None = None) -> Products:
    """Choose the products, use their library from here on, and log the choice; arguments as of `choose_products`."""
    found, source = choose_products(wanted, sizes, stored)
    products = replace(found, matmul=use_matmul(found.matmul))
    threads = f"{workers()} thread{'' if workers() == 1 else 's'}"
    log.info("machine: %s; matrix products %s (%s)", threads, products, source)
    return products


def choose_products(wanted: Products, sizes: Sizes, stored: Mapping[str, Any] | None = None) -> tuple[Products, str]:
    """Choose the products; a value other than `auto` stands.

    For the others a choice made on this machine is taken from the checkpoint, else from the cache file; else trials are
    run and their result is cached.

    Args:
        wanted: Each value `auto` or one of `CHOICES`.
        sizes: Sizes of the fit's products.
        stored: The checkpoint's `choice_record`.

    Returns:
        The products, and the source of the choice.
    """
    machine = describe_machine(sizes)
    if stored is not None and stored.get("machine") == machine and (before := _parse_products(stored)) is not None:
        return _fill_auto(wanted, before), "of the checkpoint"
    path = cache_file(machine)
    if (cached := _read(path)) is not None:
        return _fill_auto(wanted, cached), f"as measured before: {path}"
    capabilities = {} if sizes.device.type == "cuda" else torch.cpu.get_capabilities()
    with large_pieces():  # as in the fit
        found, trials = choose_by_trials(capabilities, trials_of_sizes(sizes))
    if (cached := _read(path)) is not None:  # of a process that measured at the same time: all shall have one choice
        return _fill_auto(wanted, cached), f"as measured meanwhile: {path}"
    _write(path, machine, found, trials)
    return _fill_auto(wanted, found), "measured now"


def choice_record(products: Products, sizes: Sizes) -> dict[str, Any]:
    """A choice and its machine as plain values, for the checkpoint."""
    return {"machine": describe_machine(sizes), "products": asdict(products)}


def describe_machine(sizes: Sizes) -> dict[str, Any]:
    """Processor, instructions, threads, torch and sizes: all that a choice depends on."""
    device = torch.cuda.get_device_name(sizes.device) if sizes.device.type == "cuda" else cpu_model()
    return {
        "processor": device,
        "instructions": torch.backends.cpu.get_cpu_capability(),
        "restricted": {name: os.environ[name] for name in RESTRICTED_BY if name in os.environ},
        "threads": workers(),
        "torch": str(torch.__version__),
        "sizes": [sizes.points, sizes.width, sizes.matrices],
    }


def machine_kind() -> str:
    """Vendor, instructions and cores, e.g. `AuthenticAMD, AVX512 with bfloat16, 2 cores`."""
    instructions = torch.backends.cpu.get_cpu_capability()
    if "ATEN_CPU_CAPABILITY" in os.environ:
        instructions += " (imitated)"
    elif not emulates_bfloat16(torch.cpu.get_capabilities()):
        instructions += " with bfloat16"
    return f"{cpu_vendor()}, {instructions}, {os.cpu_count()} cores"


def cache_file(machine: Mapping[str, Any]) -> Path:
    """Path of a machine's choice in the user's cache folder."""
    name = hashlib.sha256(json.dumps(machine, sort_keys=True).encode()).hexdigest()[:16]
    return user_cache_path("jointsdf") / "products" / f"{name}.json"


def _fill_auto(wanted: Products, found: Products) -> Products:
    """Replace each `auto` of the wanted products by the one found."""
    given = {key: value for key, value in asdict(wanted).items() if value != "auto"}
    return replace(found, **given)


def _read(path: Path) -> Products | None:
    """Read a cached choice; None where there is none or it is damaged."""
    try:
        return _parse_products(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, RecursionError):
        return None


def _parse_products(content: Any) -> Products | None:
    """Parse the choice of a cache file or checkpoint; None where there is no valid one."""
    try:
        products = Products(**content["products"])
    except (KeyError, TypeError, InputError):
        return None
    return products if all(value in CHOICES[key] for key, value in asdict(products).items()) else None


def _write(path: Path, machine: Mapping[str, Any], products: Products, trials: Mapping[str, Trial]) -> None:
    """Write a choice with its trials; a failure is a warning."""
    content = {
        "machine": machine,
        "products": asdict(products),
        "trials": {key: asdict(trial) for key, trial in trials.items()},
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    try:
        write_atomically(path, json.dumps(content, indent=1) + "\n")
    except OSError as error:
        log.warning("%s cannot be written (%s): the next fit measures its matrix products again", path, error.strerror)
