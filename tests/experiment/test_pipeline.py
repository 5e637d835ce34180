"""The main job on real parts, by the command that a user types: as good as the README says."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import ROOT

from jointsdf.shapes import abc

ABC_ROOT = os.environ.get("JOINTSDF_ABC", "")


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["part_01", "abc_0046"])  # made by code; real, with walls of 1.6% of its size
def test_the_fast_recipe_is_as_good_as_its_floor(tmp_path, shape):
    if shape in abc.catalogue() and not (ABC_ROOT and abc.mesh_path(shape, ABC_ROOT).is_file()):
        pytest.skip(f"set JOINTSDF_ABC to a folder that holds {shape}/mesh.ply")
    command = [sys.executable, ROOT / "train.py", "recipe=fast", f"shape={shape}", f"paths.outputs={tmp_path}"]
    run = subprocess.run(
        [*command, "paths.abc_missing=error", "trainer.accelerator=cpu"],
        env={**os.environ, "OMP_NUM_THREADS": "2"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    row = json.loads(Path(tmp_path, f"fast/base/siren/{shape}/seed0/result.json").read_text())
    scores = row["scores"]["unit"]
    assert row["status"] == "ok"
    assert scores["cd_l1"] <= 1.10 * scores["cd_l1_floor"]
    assert scores["nc"] >= scores["nc_floor"] - 0.02
    assert scores["miou_exact"] >= 0.90
    assert scores["components"] == scores["components_gt"] == 1
