"""The command line that runs a PartField checkout, here two scripts with the command lines and files of its own."""

import logging
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from partfield_output import BY_AREA, SECTION, load

from jointsdf import shapes
from jointsdf.shapes.labels.__main__ import main

# Two scripts with the command lines and files of PartField's; arguments are written down for the test.
INFERENCE = """
import sys
from pathlib import Path
import numpy as np, trimesh
words = sys.argv[1:]
assert words[:2] == ["-c", "configs/final/demo.yaml"] and words[2] == "--opts", words
options = dict(zip(words[3::2], words[4::2]))
assert Path(options["continue_ckpt"]).read_text() == "weights"
out = Path("exp_results", options["result_name"]); out.mkdir(parents=True)
for path in Path(options["dataset.data_path"]).glob("*.obj"):
    mesh = trimesh.load(path, process=False)
    order = np.random.default_rng(0).permutation(len(mesh.faces))
    low, high = mesh.bounds
    placed = (mesh.vertices - (low + high) / 2) * (1.8 / (high - low).max())
    name = path.name.split(".")[0]
    trimesh.Trimesh(placed, mesh.faces[order], process=False).export(out / f"input_{name}_0.ply")
    np.save(out / f"part_feat_{name}_0.npy", np.eye(8)[np.digitize(mesh.triangles_center[order, 0], [25.5, 31.5, 33])])
"""


CLUSTERING = """
import argparse
from pathlib import Path
import numpy as np, trimesh
parser = argparse.ArgumentParser()
for name in ("root", "dump_dir", "source_dir", "use_agglo", "max_num_clusters", "option"):
    parser.add_argument("--" + name, required=True)
given = parser.parse_args()
assert (given.use_agglo, given.max_num_clusters, given.option) == ("True", "20", "0")
assert list(Path(given.source_dir).glob("*.obj"))
out = Path(given.dump_dir)
for kind in ("cluster_out", "ply"):
    (out / kind).mkdir()
for path in Path(given.root).glob("part_feat_*.npy"):
    uid, view = path.stem.split("_")[-2:]
    section = np.load(path).argmax(axis=1)
    mesh = trimesh.load(Path(given.root) / f"input_{uid}_{view}.ply", process=False)
    for count in (1, 2, 3, 4):
        parts = np.minimum(section, count - 1)
        np.save(out / "cluster_out" / f"{uid}_{view}_{count:02d}.npy", np.array([900, 33, 12, 601])[parts])
        mesh.visual.face_colors = np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255], [9, 9, 9]], dtype=np.uint8)[parts]
        mesh.export(out / "ply" / f"{uid}_{view}_{count:02d}.ply")
"""


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    folder = tmp_path / "PartField"
    folder.mkdir()
    (folder / "partfield_inference.py").write_text(INFERENCE)
    (folder / "run_part_clustering.py").write_text(CLUSTERING)
    (folder / "model.ckpt").write_text("weights")
    return folder


def command(bar: Path, checkout: Path, *more: str) -> int:
    return main(["partfield", "--repo", str(checkout), "--checkpoint", str(checkout / "model.ckpt"), str(bar), *more])


def test_a_checkout_is_called_and_its_parts_imported(
    bar: Path, checkout: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    assert command(bar, checkout) == 0
    labels, painted = tmp_path / "bar.v2_partfield_04.npy", tmp_path / "bar.v2_partfield_04.ply"
    np.testing.assert_array_equal(np.load(labels), BY_AREA)
    for given in (labels, painted):
        shape = shapes.load(str(bar), labels=str(given), abc_root="nowhere")
        assert shape.label_provider == f"file:{given.name}"
        np.testing.assert_array_equal(shape.mesh.labels, BY_AREA)
    assert f"labels={labels}" in caplog.text
    shape = load(bar, checkout / "exp_results", num_parts=2)
    np.testing.assert_array_equal(shape.mesh.labels, (SECTION == 0).astype(int))
    assert len(load(bar, checkout / "exp_results", num_parts=6).mesh.part_ids) == 6, "from its features"
    assert command(bar, checkout, "--num-parts", "2") == 0
    np.testing.assert_array_equal(np.load(tmp_path / "bar.v2_partfield_02.npy"), (SECTION == 0).astype(int))


@pytest.mark.parametrize("case", ["no checkout", "no weights", "fails", "no mesh", "no python"])
def test_a_failing_checkout_is_one_line(bar: Path, checkout: Path, case: str, caplog: pytest.LogCaptureFixture) -> None:
    more: tuple[str, ...] = ()
    if case == "no checkout":
        (checkout / "run_part_clustering.py").unlink()
    elif case == "no weights":
        (checkout / "model.ckpt").unlink()
    elif case == "fails":
        (checkout / "partfield_inference.py").write_text("raise RuntimeError('no NVIDIA driver')")
    elif case == "no mesh":
        bar.unlink()
    else:
        more = ("--python", "/no/such/python")
    assert command(bar, checkout, *more) == 2
    message = caplog.records[-1].getMessage()
    expected = {
        "no checkout": "no run_part_clustering.py",
        "no weights": "download model_objaverse.ckpt",
        "fails": "no NVIDIA driver",
        "no mesh": "file not found",
        "no python": "/no/such/python",
    }
    assert expected[case] in message
    assert "\n" not in message
    assert not list(bar.parent.glob("*partfield_*"))


def test_the_command_line_is_a_module() -> None:
    done = subprocess.run(
        [sys.executable, "-W", "error::RuntimeWarning", "-m", "jointsdf.shapes.labels", "partfield", "--help"],
        capture_output=True, text=True, check=True, cwd=Path(__file__).parents[3],
    )  # fmt: skip
    assert "--checkpoint" in done.stdout
