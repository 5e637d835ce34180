"""A field of a ball with two parts, in a run folder and alone."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from analytic import sphere_distance
from asked_runs import FRAME, INCH, PARTS, RADIUS

from jointsdf.extraction.extractor import Extraction
from jointsdf.model.field import JointField
from jointsdf.viewing.export import write_mesh

FREQUENCY = 0.6


@pytest.fixture(scope="session")
def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a field whose surface is a ball but for 0.3% of its radius, with two parts.

    Near the surface it is k (C - cos wx - cos wy - cos wz), nearly quadratic; away from it the grid of the distance.
    """
    torch.manual_seed(0)
    trunk = {"width": 3, "depth": 1, "tap": 1, "omega": 1.0, "far": "grid", "far_resolution": 48}
    field = JointField(trunk, {"name": "siren", "widths": [8, 8], "omega": 1.0}, np.array(PARTS), FRAME).eval()
    (layer,), radius, w = field.trunk.sine_layers, RADIUS / FRAME.scale, FREQUENCY
    k = 1 / (w**2 * radius)
    with torch.no_grad():
        layer.linear.weight.copy_(w * torch.eye(3))
        layer.linear.bias.fill_(np.pi / 2)
        field.trunk.output.weight.fill_(-k)
        field.trunk.output.bias.fill_(k * (3 - (w * radius) ** 2 / 2 + (w * radius) ** 4 / 40))
        torch.nn.init.uniform_(list(field.head.parameters())[-2], -3, 3)
        directions = torch.randn(500, 3)
        logits = field.head(field.trunk(radius * directions / directions.norm(dim=1, keepdim=True))[1])
        list(field.head.parameters())[-1][0] += (logits[:, 1] - logits[:, 0]).median()  # parts of equal area
    assert field.far is not None
    field.far.fill(lambda points: sphere_distance(points, radius))
    folder = tmp_path_factory.mktemp("a run")
    field.save(folder / "field.ckpt")
    mesh = Extraction(48, borders="split").labelled_mesh(field.network_sdf, field.network_part, FRAME)
    write_mesh(folder, mesh, INCH, "y")
    stored = json.loads((Path(__file__).parents[1] / "stored/finished/result.json").read_text())
    row = {name: value for name, value in stored.items() if not name.endswith("sha256")}
    row["provenance"]["resolution"] = 48
    (folder / "result.json").write_text(json.dumps(row))
    return folder


@pytest.fixture
def field(run_folder: Path) -> JointField:
    return JointField.load(run_folder / "field.ckpt")
