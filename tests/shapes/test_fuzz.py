"""Damaged files of every format load whole, or are refused in one line, within seconds and a gigabyte.

JOINTSDF_FUZZ is the number of mutations of each format: `make fuzz` gives 2,000.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from threading import Timer

import load_files
import numpy as np
import pytest
import trimesh
from gltf_files import GltfFile
from mesh_files import BOX, OBJ, OFF, PLY, SIDES, exported
from mutations import mutate
from step_files import INCH, NEEDS_READER, TOUCHING, step_boxes

from jointsdf.values import ASSUMED_UNIT, LabelledMesh
from jointsdf.viewing.export import ply_bytes

MANY = int(os.environ.get("JOINTSDF_FUZZ", "50"))
SECONDS = 5.0  # of a processor, for one file
HANGS = 60.0  # seconds after which a file is given up
LONGEST = 600  # characters of a message
LABELLED = LabelledMesh(np.array(BOX.vertices), np.array(BOX.faces), SIDES * 3)

Case = tuple[Path, str]
Outcome = dict[str, object]


def array(save: Callable[..., None], *arguments: object) -> bytes:
    file = BytesIO()
    save(file, *arguments)
    return file.getvalue()


def text_gltf() -> bytes:
    file = GltfFile()
    file.mesh(file.primitive(BOX.vertices.astype(np.float32), BOX.faces.astype(np.uint8)))
    file.node(mesh=0, scale=[1, 1, -1])
    return file.gltf()


MESHES: dict[str, Callable[[], bytes]] = {
    "text.ply": lambda: PLY.encode(),
    "binary.ply": lambda: ply_bytes(LABELLED, ASSUMED_UNIT, "z"),
    "a.obj": lambda: b"o box\nusemtl steel\ng a b\n" + OBJ.encode() + b"v 0 0 9 # tip\nf 1 2 \\\n 4 5\n",
    "binary.stl": lambda: exported("stl"),
    "text.stl": lambda: exported("stl_ascii"),
    "a.off": lambda: OFF.encode(),
    "a.glb": lambda: trimesh.Scene({"part_0": BOX, "part_1": BOX.copy().apply_translation((9, 0, 0))}).export(
        file_type="glb"
    ),
    "a.gltf": text_gltf,
}
LABELS: dict[str, Callable[[], bytes]] = {
    "labels.npy": lambda: array(np.save, SIDES),
    "labels.npz": lambda: array(np.savez, SIDES),
    "labels.txt": lambda: b"\n".join(b"%d" % side for side in SIDES),
    "labels.csv": lambda: b"face,label\n" + b"\n".join(b"%d,%d" % pair for pair in enumerate(SIDES)),
    "labels.json": lambda: json.dumps({str(face): int(side) for face, side in enumerate(SIDES)}).encode(),
    "labels.seg": lambda: b"\n".join(b"%d" % side for side in SIDES),
    "labels.ply": lambda: ply_bytes(LABELLED, ASSUMED_UNIT, "z"),
}


def find_outcomes(cases: list[Case]) -> dict[str, Outcome]:
    """What becomes of each file, by its path; of one that never answers or ends the process, that it does."""
    found: dict[str, Outcome] = {}
    while waiting := [case for case in cases if str(case[0]) not in found]:
        before = len(found)
        for outcome in load_until_one_fails(waiting):
            found[str(outcome["path"])] = outcome
        assert len(found) > before, "the loading process does not start"
    return found


def load_until_one_fails(cases: list[Case]) -> Iterator[Outcome]:
    """Outcomes of files that one process loads, until it ends."""
    todo = cases[0][0].with_name("todo.json")
    todo.write_text(json.dumps([(str(path), labels) for path, labels in cases]))
    with subprocess.Popen([sys.executable, load_files.__file__, todo], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        timer, begun = Timer(HANGS, process.kill), ""
        timer.start()
        for line in process.stdout:
            timer.cancel()
            answer = json.loads(line)
            begun = answer.get("begun", "")
            if not begun:
                yield answer
            timer = Timer(HANGS, process.kill)
            timer.start()
        timer.cancel()
    if begun:
        yield {"path": begun, "bug": f"the process ended with {process.returncode}"}


def check_outcome(outcome: Outcome, path: Path, kind: str) -> None:
    """Check that a file was loaded or refused in one line that names it, soon."""
    said = f"{path.name} ({kind}): {outcome}"
    assert "bug" not in outcome, said
    assert float(str(outcome["seconds"])) < SECONDS, said
    error = str(outcome.get("error", path.name))
    assert path.name in error, said
    assert "\n" not in error, said
    assert len(error) < LONGEST, said


def write_mutations(folder: Path, name: str, content: bytes) -> dict[Path, str]:
    """Write files with one mutation each; the mutation's name by the path."""
    files = {}
    for number in range(MANY):
        kind, data = mutate(content, number)
        path = folder / f"{Path(name).stem}_{number}{Path(name).suffix}"
        path.write_bytes(data)
        files[path] = kind
    return files


@pytest.mark.parametrize("name", [*MESHES, pytest.param("a.step", marks=NEEDS_READER)])
def test_damaged_mesh(tmp_path: Path, name: str) -> None:
    content = MESHES[name]() if name in MESHES else step_boxes(TOUCHING, INCH).encode()
    whole = tmp_path / f"sound{Path(name).suffix}"
    whole.write_bytes(content)
    files = write_mutations(tmp_path, name, content)
    found = find_outcomes([(path, "auto") for path in (whole, *files)])
    assert isinstance(found[str(whole)].get("faces"), int)
    counts_its_faces = name != "a.obj"
    for path, kind in files.items():
        outcome = found[str(path)]
        check_outcome(outcome, path, kind)
        if counts_its_faces and kind == "cut":
            assert outcome.get("faces") in (None, found[str(whole)]["faces"]), f"{path.name}: cut, and taken for whole"


@pytest.mark.parametrize("name", LABELS)
def test_damaged_labels(tmp_path: Path, name: str) -> None:
    content = LABELS[name]()
    mesh = tmp_path / "mesh.ply"
    mesh.write_bytes(exported("ply"))
    sound = tmp_path / f"sound{Path(name).suffix}"
    sound.write_bytes(content)
    files = {sound: ""} | write_mutations(tmp_path, name, content)
    links = {path: path.with_name(f"of_{path.stem}.ply") for path in files}
    for link in links.values():
        link.symlink_to(mesh)
    found = find_outcomes([(link, str(path)) for path, link in links.items()])
    assert found[str(links[sound])].get("faces") == len(SIDES)
    for path, kind in files.items():
        check_outcome(found[str(links[path])], path, kind)
