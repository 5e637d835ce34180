"""Float32 products keep their accuracy, whatever library multiplies them."""

from collections.abc import Iterator

import pytest
import torch

from jointsdf.training import matrix_products
from jointsdf.training.matrix_products import Products, matmul, use_matmul


@pytest.fixture(autouse=True)
def as_it_was() -> Iterator[None]:
    before = torch.backends.mkldnn.matmul.fp32_precision
    yield
    torch.backends.mkldnn.matmul.fp32_precision = before


@pytest.mark.parametrize("name", ["default", "onednn"])
def test_products_stay_float32_whatever_is_used(name: str) -> None:
    use_matmul(name)
    a, b = torch.randn(700, 256), torch.randn(256, 256)
    exact = a.double() @ b.double()
    assert ((a @ b - exact).norm() / exact.norm()).item() < 1e-6


def test_a_library_that_rounds_to_bfloat16_is_left_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(matrix_products, "relative_error", lambda *_: 2e-3)
    assert use_matmul("onednn") == "default"
    assert torch.backends.mkldnn.matmul.fp32_precision != "bf16"


def test_within_the_block_alone_products_go_another_way() -> None:
    use_matmul("default")
    with matmul("onednn"):
        assert torch.backends.mkldnn.matmul.fp32_precision == "bf16"
    assert torch.backends.mkldnn.matmul.fp32_precision != "bf16"


def test_products_name_their_precision() -> None:
    assert Products().dtype("backward") is None
    assert Products(backward="bfloat16").dtype("backward") is torch.bfloat16
    assert Products(backward="bfloat16").dtype("orthogonalisation") is None
