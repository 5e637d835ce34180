"""Tables of a few runs, shared by the tests."""

from pathlib import Path

import numpy as np
import pytest
from study_rows import make_row, make_tables, results_with_the_paper, write


@pytest.fixture
def outputs(tmp_path: Path) -> Path:
    """Two heads and the baseline on two common shapes; abc_0003 lacks siren, abc_0004 was run by siren alone."""
    unit = {"cd_l1_floor": 0.2, "components": 1.0, "miou_floor": 0.9, "miou_exact_ceiling": 0.98}
    write(
        tmp_path,
        make_row("relu", "abc_0001", 0, **unit, cd_l1=0.2, nc=0.90, miou=0.5, iou_0=0.4, iou_1=0.6),
        make_row("relu", "abc_0001", 1, **unit, cd_l1=0.4, nc=0.92, miou=0.7, iou_0=0.6, iou_1=0.8),
        make_row("relu", "abc_0002", 0, **unit, cd_l1=0.5, nc=0.95, miou=0.8, iou_0=0.8),
        make_row("relu", "abc_0003", 0, **unit, cd_l1=9.0, nc=0.10, miou=0.1, iou_0=0.1),
        make_row("siren", "abc_0001", 0, **unit, cd_l1=0.2, nc=0.99, miou=0.9, iou_0=0.9, iou_1=0.9),
        make_row("siren", "abc_0002", 0, **unit, cd_l1=0.4, nc=0.89, miou=0.4, iou_0=0.4),
        make_row("siren", "abc_0004", 0, **unit, cd_l1=0.1, nc=0.99, miou=0.9, iou_0=0.9),
        make_row("none", "abc_0001", 0, **unit, provider="none", cd_l1=0.3, nc=0.91),
        make_row("none", "abc_0002", 0, **unit, provider="none", cd_l1=0.3, nc=0.91),
    )
    make_tables(tmp_path)
    return tmp_path


@pytest.fixture(scope="session")
def eight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Tables of the baseline and two heads on eight shapes of 2 to 30 parts."""
    tmp_path = tmp_path_factory.mktemp("eight")
    random = np.random.default_rng(7)
    rows = []
    for k, parts in enumerate((2, 4, 5, 8, 9, 18, 19, 30)):
        for head in ("none", "relu", "siren"):
            scores = {"cd_l1": 0.3 + 0.1 * k, "cd_l1_floor": 0.25, "nc": 0.9 - 0.01 * k, "nc_floor": 0.95}
            scores |= {
                "f1": 0.8 - 0.02 * k,
                "f1_floor": 0.8,
                "acc": 0.99 - 0.01 * k,
                "miou_exact": 0.9,
                "acc_exact": 0.95,
            }
            scores |= {"miou": random.uniform(), "consistency": random.uniform()} if head != "none" else {}
            noise = {name: value + random.normal(0, 0.01) for name, value in scores.items() if "floor" not in name}
            rows.append(make_row(head, f"abc_{k:04d}", parts=parts, **(scores | noise)))
    write(tmp_path, *rows)
    make_tables(tmp_path, results_with_the_paper(tmp_path))
    return tmp_path
