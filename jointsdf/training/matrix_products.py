"""Library and precision of the fit's matrix products, and the switch between CPU libraries."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor

from jointsdf.errors import require_one_of

CHOICES = {  # torch's own float32 products first, then the alternative
    "matmul": ("default", "onednn"),
    "backward": ("float32", "bfloat16"),
    "orthogonalisation": ("float32", "bfloat16"),
}
FLOAT32_ERROR = 1e-6  # relative; largest of products that count as float32, whose own is 3e-7
CHECKED_ROWS, CHECKED_WIDTH = 512, 256  # sizes of the product by which a library's accuracy is checked
FP32_PRECISION = {"default": "none", "onednn": "bf16"}  # torch's setting that leads to each library


@dataclass(frozen=True)
class Products:
    """The fit's matrix products; each value one of `CHOICES`, or `auto`: to be chosen on this machine.

    Attributes:
        matmul: Library of float32 products on the CPU: `default` (torch's) or `onednn`.
        backward: Precision of the trunk's backward products, `float32` or `bfloat16`.
        orthogonalisation: Precision of Muon's products, likewise.

    Raises:
        InputError: Another value.

    >>> print(Products(backward="bfloat16"))
    float32 by torch's default library, backward in bfloat16, orthogonalisation in float32
    """

    matmul: str = "default"
    backward: str = "float32"
    orthogonalisation: str = "float32"

    def __post_init__(self) -> None:
        """Check the names."""
        for key, names in CHOICES.items():
            require_one_of(f"trainer.{key}", getattr(self, key), ("auto", *names))

    def dtype(self, key: str) -> torch.dtype | None:
        """Precision of `backward` or `orthogonalisation`; None for that of the parameters."""
        return torch.bfloat16 if getattr(self, key) == "bfloat16" else None

    def __str__(self) -> str:
        """One line for the log."""
        library = {"default": "torch's default library", "onednn": "oneDNN"}[self.matmul]
        return f"float32 by {library}, backward in {self.backward}, orthogonalisation in {self.orthogonalisation}"


@dataclass(frozen=True)
class Sizes:
    """Sizes of the fit's matrices.

    Attributes:
        points: Rows of one product.
        width: Units of a hidden layer.
        matrices: Number of hidden layers that are orthogonalised together.
        device: Device of the products.
    """

    points: int
    width: int
    matrices: int
    device: torch.device


def use_matmul(name: str) -> str:
    """Multiply float32 matrices on the CPU by this library from here on.

    The setting that leads to oneDNN permits bfloat16 by its name, so a product is compared with float64 first.

    Args:
        name: `default`, or `onednn`, taken only where it keeps float32 accuracy.

    Returns:
        The library in use.
    """
    mkldnn: Any = torch.backends.mkldnn
    mkldnn.matmul.fp32_precision = FP32_PRECISION["default"]
    if name == "onednn" and mkldnn.is_available():
        mkldnn.matmul.fp32_precision = FP32_PRECISION["onednn"]
        a, b = random_matrix(CHECKED_ROWS, CHECKED_WIDTH), random_matrix(CHECKED_WIDTH, CHECKED_WIDTH)
        if relative_error(a @ b, a.double() @ b.double()) < FLOAT32_ERROR:
            return "onednn"
        mkldnn.matmul.fp32_precision = FP32_PRECISION["default"]
    return "default"


@contextmanager
def matmul_restored() -> Iterator[None]:
    """Restore the library of float32 products after the block."""
    mkldnn: Any = torch.backends.mkldnn
    before = mkldnn.matmul.fp32_precision
    try:
        yield
    finally:
        mkldnn.matmul.fp32_precision = before


@contextmanager
def matmul(name: str) -> Iterator[None]:
    """Multiply float32 matrices by this library within the block, without checking its accuracy."""
    with matmul_restored():
        mkldnn: Any = torch.backends.mkldnn
        mkldnn.matmul.fp32_precision = FP32_PRECISION[name]
        yield


def random_matrix(rows: int, columns: int) -> Float[Tensor, "r c"]:
    """Standard normal matrix, a function of its size alone."""
    return torch.randn(rows, columns, generator=torch.Generator().manual_seed(rows))


def relative_error(found: Tensor, exact: Tensor) -> float:
    """Frobenius norm of the difference over that of the exact result."""
    return float((found.double() - exact).norm() / exact.norm())
