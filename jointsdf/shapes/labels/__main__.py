"""Part labels by other programs: `python -m jointsdf.shapes.labels partfield --repo .. --checkpoint .. MESH`."""

import argparse
import logging
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import trimesh

from jointsdf.cli_logging import program_name
from jointsdf.errors import InputError
from jointsdf.shapes.labels import partfield
from jointsdf.shapes.labels.ids import number_by_area
from jointsdf.shapes.readers.file_mesh import FileMesh
from jointsdf.shapes.readers.formats import stem_of
from jointsdf.shapes.readers.triangles import read_triangles
from jointsdf.values import LabelledMesh

SCRIPTS = ("partfield_inference.py", "run_part_clustering.py")
MOST_CLUSTERS = 20  # parts that its clustering is run for, from 1

log = logging.getLogger("jointsdf.shapes.labels")


def run_partfield(repo: Path, checkpoint: Path, mesh: FileMesh, name: str, python: str) -> Path:
    """Run the user's own PartField checkout on a mesh: its features, then its clustering.

    Args:
        repo: The checkout; its results stay in its `exp_results`.
        checkpoint: PartField's weights.
        mesh: The triangles.
        name: Of the mesh in PartField's output.
        python: The interpreter of PartField's environment.

    Returns:
        The folder of PartField's results.

    Raises:
        InputError: No checkout or weights, or one of the commands fails.
    """
    if missing := [script for script in SCRIPTS if not (repo / script).is_file()]:
        raise InputError(
            f"--repo {repo} is no PartField checkout (no {missing[0]}): clone github.com/nv-tlabs/PartField"
        )
    if not checkpoint.is_file():
        raise InputError(
            f"--checkpoint {checkpoint} not found: download model_objaverse.ckpt as PartField's README says"
        )
    features, results = f"partfield_features/{name}", repo.resolve() / "exp_results"
    clusters = results / "partfield_clusters" / name
    for old in (results / features, clusters):
        shutil.rmtree(old, ignore_errors=True)
    clusters.mkdir(parents=True)
    with tempfile.TemporaryDirectory() as folder:
        trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(Path(folder, f"{name}.obj"), digits=17)
        options = ["continue_ckpt", checkpoint.resolve(), "result_name", features, "dataset.data_path", folder]
        _run_script(repo, [python, SCRIPTS[0], "-c", "configs/final/demo.yaml", "--opts", *options])
        options = ["--root", f"exp_results/{features}", "--dump_dir", clusters, "--source_dir", folder]
        options += ["--use_agglo", "True", "--max_num_clusters", MOST_CLUSTERS, "--option", 0]
        _run_script(repo, [python, SCRIPTS[1], *options])
    return results


def import_partfield(path: Path, results: Path, mesh: FileMesh, num_parts: int | None) -> tuple[Path, Path | None]:
    """Write the labels that PartField found, and its own coloured mesh, beside the mesh file.

    Args:
        path: The mesh file.
        results: PartField's output.
        mesh: The file's triangles; the labels follow their order.
        num_parts: Wanted number of parts, None for the default.

    Returns:
        The `.npy` and the `.ply`; the latter is None where PartField wrote none.

    Raises:
        InputError: PartField's output does not hold this mesh.
    """
    names = partfield.possible_names(path, mesh.sha256)[-1:]
    labels, count = partfield.read_parts(results, names, mesh, num_parts)
    labels_path, painted_path = (
        path.with_name(f"{stem_of(path)}_partfield_{count:02d}{kind}") for kind in (".npy", ".ply")
    )
    np.save(labels_path, number_by_area(LabelledMesh(mesh.vertices, mesh.faces, labels)))
    clusters = partfield.find_output(results, names).clusters.get(count)
    painted = clusters and clusters.parents[1] / "ply" / f"{clusters.stem}.ply"
    if not painted or not painted.is_file():
        return labels_path, None
    shutil.copyfile(painted, painted_path)
    return labels_path, painted_path


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code, 2 for what the user can mend."""
    parser = argparse.ArgumentParser(
        prog=program_name("jointsdf.shapes.labels"), description="Labels by other programs."
    )
    commands = parser.add_subparsers(dest="command", required=True)
    command = commands.add_parser("partfield", help="call your PartField checkout (needs CUDA), import its parts")
    command.add_argument("mesh", type=Path, help="the mesh or STEP file; the results go beside it")
    command.add_argument("--repo", type=Path, required=True, help="your clone of github.com/nv-tlabs/PartField")
    command.add_argument("--checkpoint", type=Path, required=True, help="its weights, model_objaverse.ckpt")
    command.add_argument("--num-parts", type=int, help="how many parts (the most up to 18)")
    command.add_argument("--python", default=sys.executable, help="the interpreter of PartField's environment")
    given = parser.parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    try:
        mesh, _ = read_triangles(given.mesh)
        name = partfield.possible_names(given.mesh, mesh.sha256)[-1]
        results = run_partfield(given.repo, given.checkpoint, mesh, name, given.python)
        labels, painted = import_partfield(given.mesh, results, mesh, given.num_parts)
    except (InputError, OSError) as error:
        log.error("error: %s", " ".join(str(error).split()))
        return 2
    log.info("%s%s", labels, f"\n{painted}" if painted else "")
    log.info("use it:       python train.py shape=%s labels=%s", given.mesh, labels)
    log.info(
        "other counts: python train.py shape=%s labels=partfield partfield_dir=%s num_parts=..", given.mesh, results
    )
    return 0


def _run_script(repo: Path, command: Sequence[object]) -> None:
    """Run one of PartField's scripts in its checkout, with its output on standard error."""
    words = [str(word) for word in command]
    log.info("%s", " ".join(words))
    done = subprocess.run(words, cwd=repo, stdout=sys.stderr, stderr=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["it says nothing"])[-1]
        raise InputError(f"{words[1]} failed ({last}): PartField needs its own environment (--python), with a CUDA GPU")


if __name__ == "__main__":
    sys.exit(main())
