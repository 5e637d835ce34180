"""Matrix products take the fast path only where it keeps float32 accuracy; freed memory comes back without faults."""

import platform
import resource
from collections.abc import Iterator

import pytest
import torch

from jointsdf import machine
from jointsdf.machine import choose_backward, choose_matmul, keep_freed_memory


@pytest.fixture(autouse=True)
def as_it_was() -> Iterator[None]:
    before = torch.backends.mkldnn.matmul.fp32_precision
    yield
    torch.backends.mkldnn.matmul.fp32_precision = before


def processor(monkeypatch: pytest.MonkeyPatch, **capabilities: str | bool) -> None:
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: capabilities)


@pytest.mark.parametrize("wanted", ["auto", "default", "onednn"])
def test_products_stay_float32_whatever_is_chosen(wanted: str) -> None:
    choose_matmul(wanted)
    a, b = torch.randn(700, 256), torch.randn(256, 256)
    exact = a.double() @ b.double()
    assert ((a @ b - exact).norm() / exact.norm()).item() < 1e-6


@pytest.mark.parametrize(
    ("cpu", "avx512", "expected"), [("AMD EPYC", True, True), ("AMD EPYC", False, False), ("Intel Xeon", True, False)]
)
def test_auto_switches_on_amd_with_avx512_alone(
    monkeypatch: pytest.MonkeyPatch, cpu: str, avx512: bool, expected: bool
) -> None:
    processor(monkeypatch, cpu_name=cpu, avx512_f=avx512)
    monkeypatch.setattr(machine, "_product_error", lambda: 2e-7)
    assert choose_matmul("auto") == ("onednn" if expected else "default")
    assert (torch.backends.mkldnn.matmul.fp32_precision == "bf16") == expected


def test_a_path_that_rounds_to_bfloat16_is_left_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine, "_product_error", lambda: 2e-3)
    assert choose_matmul("onednn") == "default"
    assert torch.backends.mkldnn.matmul.fp32_precision != "bf16"


@pytest.mark.parametrize(
    ("wanted", "bf16", "expected"),
    [
        ("float32", True, None),
        ("bfloat16", False, torch.bfloat16),
        ("auto", True, torch.bfloat16),
        ("auto", False, None),
    ],
)
def test_backward_precision(
    monkeypatch: pytest.MonkeyPatch, wanted: str, bf16: bool, expected: torch.dtype | None
) -> None:
    processor(monkeypatch, avx512_bf16=bf16)
    assert choose_backward(wanted, gpu=False) == expected


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="the allocator of glibc is set")
def test_memory_of_a_step_is_reused_without_page_faults() -> None:
    assert keep_freed_memory()

    def step() -> None:
        for _ in range(20):
            torch.ones(5_000_000 // 4)
            torch.ones(20_000_000 // 4)

    step()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    step()
    assert resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before < 1000, "25 MB are 6,100 pages, 20 times"
