"""Loss curves are the values in the event files."""

from pathlib import Path

import pytest

from jointsdf.study.figures.loss_curves import loss_curves, read_curves
from jointsdf.study.groups import Group


def test_loss_curves_are_the_events(tmp_path: Path, group: Group) -> None:
    from torch.utils.tensorboard import SummaryWriter

    for head, scale in (("relu", 1.0), ("siren", 2.0)):
        for k in range(4):
            with SummaryWriter(str(tmp_path / "main" / "base" / head / f"part_0{k}" / "seed0" / "tb")) as writer:
                for step in (0, 10, 20):
                    writer.add_scalar("loss/total", scale * (k + 1) / (step + 1), step)
                    writer.add_scalar("result/nc", 1.0, step)
    read = read_curves(tmp_path / "main" / "base" / "relu" / "part_01" / "seed0" / "tb")
    assert list(read) == ["total"]
    assert read["total"].to_dict() == pytest.approx({0: 2.0, 10: 2 / 11, 20: 2 / 21})
    drawing, missing = loss_curves(group, tmp_path)
    assert drawing is not None
    assert len(missing) == 4
    assert "hybrid" in missing[0]
    lines = {line.get_label(): line for line in drawing.figure.axes[0].lines}
    assert list(lines["siren"].get_xdata()) == [0, 10, 20]
    assert list(lines["siren"].get_ydata()) == pytest.approx([5.0, 5 / 11, 5 / 21])  # median of 2, 4, 6, 8
    assert drawing.figure.axes[0].get_yscale() == "log"
    assert "(relu 4, siren 4)" in drawing.caption
