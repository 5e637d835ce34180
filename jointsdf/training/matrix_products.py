"""How the fit multiplies matrices on this machine: by which library and in which precision, timed before it is taken.

torch's own float32 products are the default. Another way is taken if it is accurate enough and faster by `FASTER` in
each of `REPEATS` comparisons side by side, at the fit's own sizes. What a processor can do says nothing about how fast
it does it: one without bfloat16 instructions emulates such products, hundreds of times slower than float32.
"""

import hashlib
import json
import logging
import math
import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Float
from platformdirs import user_cache_path
from torch import Tensor

from jointsdf.errors import InputError, require_one_of
from jointsdf.optimizers import ITERATIONS, orthogonalised
from jointsdf.runs.files import write_atomically
from jointsdf.runs.provenance import cpu_model, cpu_vendor
from jointsdf.threads import large_pieces, workers

REPEATS, FASTER = 5, 1.3
BEST_OF = 3  # runs of each side in one repeat, of which the fastest counts: others may use the machine as well
FLOAT32_ERROR, BFLOAT16_ERROR = 1e-6, 2e-2  # relative, of what is timed; float32 gives 3e-7, bfloat16 3e-3
RESTRICTED_BY = ("ATEN_CPU_CAPABILITY", "ONEDNN_MAX_CPU_ISA", "MKL_ENABLE_INSTRUCTIONS")  # part of what a machine is
BFLOAT16_INSTRUCTIONS = ("avx512_bf16", "amx_bf16", "avx10_2")  # of x86; without any of them bfloat16 is emulated
CHOICES = {
    "matmul": ("default", "onednn"),
    "backward": ("float32", "bfloat16"),
    "orthogonalisation": ("float32", "bfloat16"),
}

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Products:
    """The fit's matrix products.

    Attributes:
        matmul: Library of float32 products on the CPU: `default` (torch's) or `onednn`.
        backward: Precision of the trunk's backward products, `float32` or `bfloat16`.
        orthogonalisation: Precision of Muon's products, likewise.
    """

    matmul: str = "default"
    backward: str = "float32"
    orthogonalisation: str = "float32"

    def __post_init__(self) -> None:
        """Check the names; `auto` is a wish, and no product is made with it."""
        for key, names in CHOICES.items():
            require_one_of(f"trainer.{key}", getattr(self, key), ("auto", *names))

    def dtype(self, key: str) -> torch.dtype | None:
        """Of `backward` or `orthogonalisation`, where it is not the parameters' own."""
        return torch.bfloat16 if getattr(self, key) == "bfloat16" else None

    def __str__(self) -> str:
        """For the log."""
        library = {"default": "torch's default library", "onednn": "oneDNN"}[self.matmul]
        return f"float32 by {library}, backward in {self.backward}, orthogonalisation in {self.orthogonalisation}"


@dataclass(frozen=True)
class Sizes:
    """What the fit multiplies.

    Attributes:
        points: Of one product.
        width: Of a hidden layer.
        matrices: How many hidden layers are orthogonalised together.
        device: Where.
    """

    points: int
    width: int
    matrices: int
    device: torch.device


@dataclass(frozen=True)
class Trial:
    """A way to multiply, compared with torch's float32 products.

    Attributes:
        error: Relative, against float64.
        ratios: How many times as fast it was in each repeat; a repeat that is lost ends the comparison.
    """

    error: float
    ratios: tuple[float, ...]

    def passed(self, most: float) -> bool:
        """Whether it is taken: accurate to `most`, and ahead in every repeat."""
        return self.error < most and len(self.ratios) == REPEATS and min(self.ratios) >= FASTER


Trials = Callable[[str, Products], Trial]  # (key of CHOICES, what is chosen so far) -> its other way, timed


def used(wanted: Products, sizes: Sizes, stored: Mapping[str, Any] | None = None) -> Products:
    """Choose, use the library from here on, and say so; the arguments are `chosen`'s."""
    found, source = chosen(wanted, sizes, stored)
    products = replace(found, matmul=use_matmul(found.matmul))
    threads = f"{workers()} thread{'' if workers() == 1 else 's'}"
    log.info("machine: %s; matrix products %s (%s)", threads, products, source)
    return products


def chosen(wanted: Products, sizes: Sizes, stored: Mapping[str, Any] | None = None) -> tuple[Products, str]:
    """What the fit uses, and where the choice comes from.

    A value that is not `auto` stands. For the others a checkpoint's choice made on this machine wins, then what was
    measured here before, so that the bits of a fit do not depend on a moment's load; then it is measured.

    Args:
        wanted: Each `auto` or one of `CHOICES`.
        sizes: Of the fit's products.
        stored: From a checkpoint, as `noted` made it.
    """
    machine = this_machine(sizes)
    if stored is not None and stored.get("machine") == machine and (before := _products(stored)) is not None:
        return _filled(wanted, before), "of the checkpoint"
    path = kept_path(machine)
    if (kept := _read(path)) is not None:
        return _filled(wanted, kept), f"as measured before: {path}"
    capabilities = {} if sizes.device.type == "cuda" else torch.cpu.get_capabilities()
    with large_pieces():  # as in the fit
        found, trials = choose(capabilities, _timed(sizes))
    _keep(path, machine, found, trials)
    return _filled(wanted, found), "measured now"


def noted(products: Products, sizes: Sizes) -> dict[str, Any]:
    """A choice as a checkpoint holds it."""
    return {"machine": this_machine(sizes), "products": asdict(products)}


def choose(capabilities: Mapping[str, Any], trial: Trials) -> tuple[Products, dict[str, Trial]]:
    """The fastest way of each key of `CHOICES` that is accurate enough, and the comparisons made for it.

    Args:
        capabilities: Of the processor, as `torch.cpu.get_capabilities` names them.
        trial: Compares one way; not called for what the processor emulates.
    """
    products, trials = Products(), {}
    for key, (_, other) in CHOICES.items():
        if other == "bfloat16" and emulates_bfloat16(capabilities):
            continue
        trials[key] = trial(key, products)
        if trials[key].passed(BFLOAT16_ERROR if other == "bfloat16" else FLOAT32_ERROR):
            products = replace(products, **{key: other})
    return products, trials


def emulates_bfloat16(capabilities: Mapping[str, Any]) -> bool:
    """Whether this processor is known to have no instructions for bfloat16 products."""
    x86 = capabilities.get("architecture") in ("x86_64", "amd64", "AMD64")
    return x86 and not any(capabilities.get(name) for name in BFLOAT16_INSTRUCTIONS)


def use_matmul(name: str) -> str:
    """Have float32 matrices on the CPU multiplied by this library from here on; gives the one that is.

    The switch that leads to oneDNN permits bfloat16 by its name, so the products are compared with float64 first.

    Args:
        name: `default`, or `onednn`, taken where it keeps float32 accuracy.
    """
    mkldnn: Any = torch.backends.mkldnn
    mkldnn.matmul.fp32_precision = "none"
    if name == "onednn" and mkldnn.is_available():
        mkldnn.matmul.fp32_precision = "bf16"
        a, b = _random(512, 256), _random(256, 256)
        if _error(a @ b, a.double() @ b.double()) < FLOAT32_ERROR:
            return "onednn"
        mkldnn.matmul.fp32_precision = "none"
    return "default"


@contextmanager
def matmul_restored() -> Iterator[None]:
    """After the block float32 products are multiplied by the library of before."""
    mkldnn: Any = torch.backends.mkldnn
    before = mkldnn.matmul.fp32_precision
    try:
        yield
    finally:
        mkldnn.matmul.fp32_precision = before


@contextmanager
def matmul(name: str) -> Iterator[None]:
    """Within the block, float32 products by this library, taken on trust."""
    with matmul_restored():
        mkldnn: Any = torch.backends.mkldnn
        mkldnn.matmul.fp32_precision = {"default": "none", "onednn": "bf16"}[name]
        yield


def this_machine(sizes: Sizes) -> dict[str, Any]:
    """What a choice holds for."""
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


def kept_path(machine: Mapping[str, Any]) -> Path:
    """The file in the user's cache folder that keeps the choice for a machine."""
    name = hashlib.sha256(json.dumps(machine, sort_keys=True).encode()).hexdigest()[:16]
    return user_cache_path("jointsdf") / "products" / f"{name}.json"


def compared(
    usual: Callable[[], object], other: Callable[[], object], *, clock: Callable[[], float] = time.perf_counter
) -> tuple[float, ...]:
    """How many times as fast the other one is, in turns; the first repeat that it does not win by `FASTER` is the last.

    Args:
        usual: What it is compared with.
        other: What may be taken.
        clock: Seconds.
    """

    def seconds(product: Callable[[], object]) -> float:
        taken = []
        for _ in range(BEST_OF):
            start = clock()
            product()
            taken.append(clock() - start)
        return min(taken)

    usual()  # the first call prepares what the others use
    other()
    ratios: list[float] = []
    while len(ratios) < REPEATS and (not ratios or ratios[-1] >= FASTER):
        ratios.append(seconds(usual) / seconds(other))
    return tuple(ratios)


def _timed(sizes: Sizes) -> Trials:
    """Comparisons on this machine."""
    width, gpu = sizes.width, sizes.device.type == "cuda"
    values, other, weights = (_random(n, width).to(sizes.device) for n in (sizes.points, sizes.points, width))
    hidden = _random(sizes.matrices * width, width).to(sizes.device).view(-1, width, width)

    def backward(dtype: torch.dtype) -> Tensor:
        """A layer's: on to the layer before, and the gradient of its weights."""
        low = values.to(dtype)
        return torch.cat([low @ weights.to(dtype), low.T @ other.to(dtype)]).to(torch.promote_types(dtype, torch.float))

    def orthogonalisation(dtype: torch.dtype) -> Tensor:
        return orthogonalised(hidden.to(torch.promote_types(dtype, torch.float)), ITERATIONS["five"][:1], dtype)

    def trial(key: str, products: Products) -> Trial:
        if key == "matmul" and gpu:
            return Trial(math.inf, ())  # a library of the CPU
        product = orthogonalisation if key == "orthogonalisation" else backward
        low = torch.float32 if key == "matmul" else torch.bfloat16

        def run(dtype: torch.dtype, library: str) -> Tensor:
            with matmul(library):
                found = product(dtype)
            if gpu:
                torch.cuda.synchronize(sizes.device)
            return found

        usual = partial(run, torch.float32, products.matmul)
        tried = partial(run, low, "onednn" if key == "matmul" else products.matmul)
        return Trial(_error(tried(), product(torch.float64)), compared(usual, tried))

    return trial


def _filled(wanted: Products, found: Products) -> Products:
    """What is wanted, `auto` replaced by what was found."""
    given = {key: value for key, value in asdict(wanted).items() if value != "auto"}
    return replace(found, **given)


def _read(path: Path) -> Products | None:
    """The choice that the file keeps; None where there is none or it is damaged."""
    try:
        return _products(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError):
        return None


def _products(content: Any) -> Products | None:
    """The choice in a file or checkpoint; None where it is not one."""
    try:
        products = Products(**content["products"])
    except (KeyError, TypeError, InputError):
        return None
    return products if all(value in CHOICES[key] for key, value in asdict(products).items()) else None


def _keep(path: Path, machine: Mapping[str, Any], products: Products, trials: Mapping[str, Trial]) -> None:
    """Write the choice with what it was made from; without a cache folder it is made again next time."""
    content = {
        "machine": machine,
        "products": asdict(products),
        "trials": {key: asdict(trial) for key, trial in trials.items()},
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, json.dumps(content, indent=1) + "\n")
    except OSError as error:
        log.warning("%s cannot be written (%s): the next fit measures its matrix products again", path, error.strerror)


def _random(rows: int, columns: int) -> Float[Tensor, "r c"]:
    return torch.randn(rows, columns, generator=torch.Generator().manual_seed(rows))


def _error(found: Tensor, exact: Tensor) -> float:
    """Relative."""
    return float((found.double() - exact).norm() / exact.norm())
