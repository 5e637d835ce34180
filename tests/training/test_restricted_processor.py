"""A fit as a processor without AVX-512 makes it: it takes no bfloat16 product, since those would be emulated.

A process of its own, with the switches by which torch, oneDNN and MKL leave newer instructions alone. What ran is read
from torch's profiler, of all threads.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from command_line import ROOT

AVX2 = {"ATEN_CPU_CAPABILITY": "avx2", "ONEDNN_MAX_CPU_ISA": "AVX2", "MKL_ENABLE_INSTRUCTIONS": "AVX2"}
FIT = """
import sys, tempfile
from pathlib import Path
import torch
from torch._C._profiler import _ExperimentalConfig
from torch.profiler import ProfilerActivity, profile
from benchmarks.scene import built, composed
from jointsdf.experiment.build import fit_machine
from jointsdf.training.fit import fit
from jointsdf.threads import large_pieces

torch.set_num_threads(2)
cfg = composed("trainer.max_steps=3", "data.pool_size=20000", "trunk.width=64", *sys.argv[2:])
_, data, module = built(cfg)
everything = _ExperimentalConfig(profile_all_threads=True)
with tempfile.TemporaryDirectory() as folder, large_pieces():
    fit(module, data, Path(folder) / "warm", fit_machine(cfg))  # and choose
    with profile(activities=[ProfilerActivity.CPU], record_shapes=True, experimental_config=everything) as seen:
        _, facts = fit(module, data, Path(folder) / "seen", fit_machine(cfg))
seen.export_chrome_trace(sys.argv[1])
print(torch.backends.cpu.get_cpu_capability(), facts["backward"], facts["orthogonalisation"])
"""
PRODUCTS = {"aten::mm", "aten::addmm", "aten::addmm_", "aten::bmm", "aten::baddbmm", "aten::matmul"}


def restricted_fit(tmp_path: Path, *overrides: str) -> tuple[list[str], list[list[str]]]:
    """What the process says of itself, and the types of each product's matrices."""
    trace = tmp_path / "trace.json"
    answer = subprocess.run(
        [sys.executable, "-c", FIT, str(trace), *overrides],
        env={**os.environ, **AVX2, "PYTHONPATH": str(ROOT)},
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert answer.returncode == 0, answer.stderr
    events = json.loads(trace.read_text())["traceEvents"]
    products = [event["args"].get("Input type", []) for event in events if event.get("name") in PRODUCTS]
    return answer.stdout.split(), products


@pytest.mark.slow
@pytest.mark.skipif(not torch.cpu.get_capabilities().get("avx2"), reason="not a processor that could be restricted")
def test_a_fit_without_avx512_multiplies_nothing_in_bfloat16(tmp_path: Path) -> None:
    said, products = restricted_fit(tmp_path)
    assert said == ["AVX2", "float32", "float32"]
    assert len(products) > 200
    assert all("float" in types and "c10::BFloat16" not in types for types in products)


@pytest.mark.slow
@pytest.mark.skipif(not torch.cpu.get_capabilities().get("avx2"), reason="not a processor that could be restricted")
def test_the_profiler_would_have_seen_it(tmp_path: Path) -> None:
    """Forced to, the same fit takes bfloat16 in both places, and in threads of the pool alone."""
    said, products = restricted_fit(tmp_path, "trainer.backward=bfloat16", "trainer.orthogonalisation=bfloat16")
    assert said == ["AVX2", "bfloat16", "bfloat16"]
    assert any("c10::BFloat16" in types for types in products)
