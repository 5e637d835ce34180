import errno
import hashlib
import http.server
import logging
import os
import re
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import py7zr
import pytest
import trimesh
from step_files import METRE, NEEDS_READER, step_boxes

from jointsdf import abc_dataset as preparation
from jointsdf import shapes
from jointsdf.abc_dataset import archive, chunks, command, convert, download, members
from jointsdf.errors import InputError
from jointsdf.shapes import abc

ABC = Path(os.environ.get("JOINTSDF_ABC", "absent"))
RAW = ABC.parent / "abc_raw"
NEEDS_RAW = pytest.mark.skipif(not RAW.is_dir(), reason="no abc_raw beside the folder that JOINTSDF_ABC names")
NAME = "abc_0003"
MODEL = "00000007_b33a147f86da49879455d286"
OBJ, YML = f"{MODEL}_trimesh_000.obj", f"{MODEL}_features_000.yml"
OTHER_NAME, OTHER = "abc_0004", "00000009_9b3d6a97e8de4aa193b81000"
ASSEMBLY = "00000050_80d90bfdd2e74e709956122a_step_000.step"  # abc_0008, abc_0009


def box(sides: tuple[float, ...], corner: tuple[float, ...] = (0.0, 0.0, 0.0)) -> trimesh.Trimesh:
    return trimesh.creation.box(bounds=[corner, np.add(corner, sides)])


def obj_text(*boxes: trimesh.Trimesh) -> bytes:
    mesh = trimesh.util.concatenate(boxes)
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in mesh.vertices]
    return "\n".join(lines + [f"f {a} {b} {c}" for a, b, c in mesh.faces + 1]).encode()


def sides_of(mesh: trimesh.Trimesh) -> np.ndarray:
    """Of a box, the side that each face is on."""
    normals = np.round(np.array(mesh.face_normals)).astype(int)
    return np.unique(normals, axis=0, return_inverse=True)[1].reshape(-1)


def yml_text(patches: np.ndarray) -> bytes:
    surfaces = [
        f"- face_indices: [{', '.join(map(str, np.flatnonzero(patches == each)))}]\n  type: Plane\n"
        for each in np.unique(patches)
    ]
    return ("curves: []\nsurfaces:\n" + "".join(surfaces)).encode()


MESH = box(tuple(side / 1000 for side in abc.catalogue()[NAME].extents), (0.1, -0.2, 0.3))  # metres
PATCHES = sides_of(MESH)
FILES = {OBJ: obj_text(MESH), YML: yml_text(PATCHES)}


def seven_zip(path: Path, files: dict[str, bytes], *, blocks: bool = False) -> Path:
    """A 7z file, its members together or each in a block of its own."""
    for number, (name, data) in enumerate(files.items()):
        with py7zr.SevenZipFile(path, "a" if number else "w") as opened:
            if blocks:
                opened.writestr(data, name)
                continue
            for each, content in files.items():
                opened.writestr(content, each)
            break
    return path


def filled(folder: Path, files: dict[str, bytes] | None = None) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for name, data in (FILES if files is None else files).items():
        (folder / name).write_bytes(data)
    return folder


def outcomes(
    root: Path, *sources: Path, names: tuple[str, ...] = (NAME,), **options: str
) -> dict[str, tuple[str, str]]:
    found = preparation.prepare(names, root, sources, **options)
    return {each.name: (each.status, each.detail) for each in found}


def assert_box_is_prepared(root: Path) -> None:
    mesh = trimesh.load(root / NAME / "mesh.ply", process=False)
    assert np.allclose(mesh.vertices, MESH.vertices * 1000, atol=1e-4)
    assert (mesh.faces == MESH.faces).all()
    patches = np.load(root / NAME / "patches.npy")
    assert patches.dtype == np.int32
    assert (patches == PATCHES).all()


class Server:
    """A web server on this machine that breaks as it is told to."""

    def __init__(self) -> None:
        self.files: dict[str, bytes] = {}
        self.ranges: list[str | None] = []  # of each request
        self.cuts: list[int] = []  # bytes after which each of the next answers breaks off
        self.codes: list[int] = []  # of the next answers
        self.knows_ranges = True
        served = self

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                served.ranges.append(self.headers.get("Range"))
                data = served.files.get(self.path)
                if data is None or served.codes:
                    self.send_error(served.codes.pop(0) if served.codes else 404)
                    return
                start = int(served.ranges[-1][6:-1]) if served.ranges[-1] and served.knows_ranges else 0
                self.send_response(206 if start else 200)
                if start:
                    self.send_header("Content-Range", f"bytes {start}-{len(data) - 1}/{len(data)}")
                self.send_header("Content-Length", str(len(data) - start))
                self.end_headers()
                self.wfile.write(data[start:][: served.cuts.pop(0) if served.cuts else None])

            def log_message(self, *_: object) -> None:
                pass

        self.web = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.thread = threading.Thread(target=self.web.serve_forever, kwargs={"poll_interval": 0.01})
        self.thread.start()

    def chunk(self, kind: str, path: Path, **wrong: object) -> chunks.Chunk:
        """The served file as the list would give it."""
        data = path.read_bytes()
        self.files[f"/{kind}"] = data
        url = f"http://127.0.0.1:{self.web.server_port}/{kind}"
        right = {"kind": kind, "chunk": "0000", "url": url, "md5": hashlib.md5(data).hexdigest(), "bytes": len(data)}
        return chunks.Chunk(**{**right, **wrong})

    def close(self) -> None:
        self.web.shutdown()
        self.thread.join()
        self.web.server_close()


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[Server]:
    monkeypatch.setenv("no_proxy", "*")
    running = Server()
    yield running
    running.close()


@pytest.fixture
def chunk(server: Server, tmp_path: Path) -> chunks.Chunk:
    """A chunk of features, large enough to be cut."""
    noise = np.random.default_rng(0).bytes(300_000)
    return server.chunk("feat", seven_zip(tmp_path / "served.7z", {**FILES, "noise": noise}))


def urls(tmp_path: Path, *served: chunks.Chunk) -> Path:
    table = tmp_path / "urls.csv"
    rows = [f"{each.kind},{each.chunk},{each.url},{each.md5},{each.bytes}" for each in served]
    table.write_text("\n".join([",".join(chunks.COLUMNS), *rows]))
    return table


def fetch(chunk: chunks.Chunk, folder: Path) -> Path:
    return download.fetch(chunk, folder, pause=0.0, timeout=5.0)


@pytest.fixture
def run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> Callable[..., SimpleNamespace]:
    """The command in this process, on the shapes of one folder."""
    monkeypatch.setattr(download.time, "sleep", lambda _: None)
    caplog.set_level(logging.INFO)

    def call(*arguments: object, shape: str = NAME) -> SimpleNamespace:
        caplog.clear()
        words = ["prepare", "--root", str(tmp_path / "root"), "--shapes", shape, *map(str, arguments)]
        code = command.main(words)
        errors = [each.getMessage() for each in caplog.records if each.levelno == logging.ERROR]
        return SimpleNamespace(code=code, errors=errors, text=caplog.text)

    return call


# The table of chunks


def test_a_models_chunk_follows_from_its_number() -> None:
    numbers = [chunks.chunk_of(each) for each in ("00000000", "00009999", "00010000", "00016513_3d69")]
    assert numbers == ["0000", "0000", "0001", "0001"]
    needed = {chunks.chunk_of(entry.abc_id) for entry in abc.catalogue().values()}
    assert {(each.kind, each.chunk) for each in chunks.table()} == {(k, n) for k in chunks.KINDS for n in needed}


@NEEDS_RAW
def test_the_table_says_what_abcs_lists_say() -> None:
    for each in chunks.table():
        assert f"{each.url} {each.name}" in (RAW / f"{each.kind}_v00.txt").read_text().splitlines()
        assert f"{each.name}: {each.md5}" in (RAW / "md5.yml").read_text().splitlines()
        assert f"{each.name}: {each.bytes}" in (RAW / "size.yml").read_text().splitlines()


def test_sizes_that_are_promised_are_those_of_the_table() -> None:
    sizes = {
        kind: sum(each.bytes for each in chunks.needed(chunks.table(), [kind], [chunks.MAIN])) for kind in chunks.KINDS
    }
    assert command.size(sizes["step"]) == "1.6 GB"
    assert command.size(sizes["obj"] + sizes["feat"]) == "12.5 GB"


def test_addresses_change_by_a_list_as_abcs_own(tmp_path: Path) -> None:
    own = tmp_path / "list.txt"
    own.write_text("https://mirror.org/1 abc_0000_step_v00.7z\nhttps://mirror.org/2 abc_0099_step_v00.7z\n\n")
    before, after = chunks.table(), chunks.table(own)
    assert after[0] == chunks.Chunk("step", "0000", "https://mirror.org/1", before[0].md5, before[0].bytes)
    assert after[1:] == before[1:]


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("file:///etc/passwd abc_0000_step_v00.7z", "line 1"),
        ("https://a.org/1", "line 1"),
        ("kind,chunk,url,md5,bytes\nstep,0000,ftp://a.org,695388be7a278c7798c8c8ae239772ac,5", "line 2"),
        ("kind,chunk,url,md5,bytes\nstep,0000,http://a.org,695388be,5", "line 2"),
        ("kind,chunk,url,md5,bytes\nstep,0000,http://a.org,695388be7a278c7798c8c8ae239772ac,0", "line 2"),
        ("kind,chunk,url,md5,bytes\nmeta,0000,http://a.org,695388be7a278c7798c8c8ae239772ac,5", "line 2"),
    ],
)
def test_an_unusable_list_is_refused(tmp_path: Path, text: str, named: str) -> None:
    own = tmp_path / "list.txt"
    own.write_text(text)
    with pytest.raises(InputError, match=named) as refused:
        chunks.table(own)
    assert str(own) in str(refused.value)


# Downloads


def test_a_download_that_is_cut_goes_on_where_it_stopped(server: Server, chunk: chunks.Chunk, tmp_path: Path) -> None:
    server.cuts = [chunk.bytes // 2, 1000]
    assert fetch(chunk, tmp_path / "in").read_bytes() == server.files["/feat"]
    assert server.ranges == [None, f"bytes={chunk.bytes // 2}-", f"bytes={chunk.bytes // 2 + 1000}-"]
    assert [each.name for each in (tmp_path / "in").iterdir()] == [chunk.name]
    fetch(chunk, tmp_path / "in")
    assert len(server.ranges) == 3


def test_a_download_that_keeps_breaking_is_kept_for_the_next_run(
    server: Server, chunk: chunks.Chunk, tmp_path: Path
) -> None:
    server.cuts = [1000, 1000, 1000]
    with pytest.raises(InputError, match=f"3000 of {chunk.bytes} bytes are here after 3 tries") as refused:
        fetch(chunk, tmp_path)
    assert "\n" not in str(refused.value)
    assert download.part_of(chunk, tmp_path).read_bytes() == server.files["/feat"][:3000]
    assert fetch(chunk, tmp_path).read_bytes() == server.files["/feat"]
    assert server.ranges == [None, "bytes=1000-", "bytes=2000-", "bytes=3000-"]


def test_a_server_that_knows_no_ranges_sends_all_again(server: Server, chunk: chunks.Chunk, tmp_path: Path) -> None:
    server.cuts, server.knows_ranges = [chunk.bytes // 2], False
    assert fetch(chunk, tmp_path / "in").read_bytes() == server.files["/feat"]


def test_a_wrong_md5_deletes_the_download_and_names_both(chunk: chunks.Chunk, tmp_path: Path) -> None:
    wrong = chunks.Chunk(chunk.kind, chunk.chunk, chunk.url, "0" * 32, chunk.bytes)
    with pytest.raises(InputError, match=f"{chunk.md5}.*{'0' * 32}"):
        fetch(wrong, tmp_path / "in")
    assert list((tmp_path / "in").iterdir()) == []


def test_a_part_of_something_else_is_found_out(server: Server, chunk: chunks.Chunk, tmp_path: Path) -> None:
    download.part_of(chunk, tmp_path).write_bytes(b"x" * 5000)
    with pytest.raises(InputError, match="md5"):
        fetch(chunk, tmp_path)
    assert fetch(chunk, tmp_path).read_bytes() == server.files["/feat"]
    assert server.ranges == ["bytes=5000-", None]


def test_an_address_without_the_file_is_not_tried_again(server: Server, chunk: chunks.Chunk, tmp_path: Path) -> None:
    server.files.clear()
    with pytest.raises(InputError, match=r"answers 404.*--urls"):
        fetch(chunk, tmp_path)
    assert server.ranges == [None]


def test_a_busy_server_is_tried_again(server: Server, chunk: chunks.Chunk, tmp_path: Path) -> None:
    server.codes = [503, 429]
    assert fetch(chunk, tmp_path / "in").read_bytes() == server.files["/feat"]


def test_a_page_in_the_archives_place_is_refused_before_it_is_written(
    server: Server, chunk: chunks.Chunk, tmp_path: Path
) -> None:
    server.files["/feat"] = b"<html>We have moved</html>"
    with pytest.raises(InputError, match=f"26 bytes.*{chunk.bytes}"):
        fetch(chunk, tmp_path / "in")
    assert list((tmp_path / "in").iterdir()) == []


def test_nobody_there(chunk: chunks.Chunk, tmp_path: Path) -> None:
    gone = chunks.Chunk(chunk.kind, chunk.chunk, "http://127.0.0.1:1/x", chunk.md5, chunk.bytes)
    with pytest.raises(InputError, match=r"refused.*after 3 tries"):
        fetch(gone, tmp_path)


def test_a_full_disk_keeps_what_has_come(
    server: Server, chunk: chunks.Chunk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def write(file: object, block: bytes) -> None:
        file.write(block[:2000])
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(download, "_write", write)
        with pytest.raises(InputError, match="the disk is full"):
            fetch(chunk, tmp_path)
    assert server.ranges == [None]
    assert fetch(chunk, tmp_path).read_bytes() == server.files["/feat"]
    assert server.ranges == [None, "bytes=2000-"]


def test_what_cannot_fit_is_not_begun(
    server: Server, chunk: chunks.Chunk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=chunk.bytes - 1))
    with pytest.raises(InputError, match="--root"):
        fetch(chunk, tmp_path)
    assert server.ranges == []


# Archives


def take(path: Path, folder: Path) -> list[str]:
    return [each.name for each in archive.extract(path, lambda name: members.parsed(name) is not None, folder)]


@pytest.mark.parametrize("blocks", [False, True])
def test_only_what_is_needed_is_taken_out(tmp_path: Path, blocks: bool) -> None:
    inside = {f"00000007/{OBJ}": FILES[OBJ], "00000007/other.txt": b"1", f"00000007/{YML}": FILES[YML], "last": b"2"}
    path = seven_zip(tmp_path / "some.7z", inside, blocks=blocks)
    assert sorted(take(path, tmp_path / "in")) == sorted(FILES)
    assert {each.name: each.read_bytes() for each in (tmp_path / "in").iterdir()} == FILES


@pytest.mark.parametrize("name", ["../../x", "a/../../x", "/x", "C:x", "..\\x", "a\\..\\x", "\\x", ".."])
def test_a_member_outside_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setattr(py7zr.SevenZipFile, "_sanitize_archive_arcname", staticmethod(lambda name: name))
    monkeypatch.setattr(sys.modules["py7zr.py7zr"], "check_archive_path", lambda _: True)
    path = seven_zip(filled(tmp_path / "deep", {}) / "hostile.7z", {**FILES, name: b"x"})
    shown = repr(name.replace("\\", "/"))  # as the reader gives it
    with pytest.raises(InputError, match=f"{re.escape(shown)}.*nothing is taken"):
        take(path, tmp_path / "deep" / "in")
    assert [each.name for each in tmp_path.rglob("*") if each.is_file()] == ["hostile.7z"]


def test_names_with_dots_are_inside(tmp_path: Path) -> None:
    assert sorted(take(seven_zip(tmp_path / "some.7z", {**FILES, "a..b/c...": b"", "...": b"x"}), tmp_path)) == sorted(
        FILES
    )


def test_a_link_is_refused(tmp_path: Path) -> None:
    (tmp_path / "aim").write_text("secret")
    (tmp_path / OBJ).symlink_to("aim")
    with py7zr.SevenZipFile(tmp_path / "some.7z", "w") as opened:
        opened.write(tmp_path / "aim", "aim")
        opened.write(tmp_path / OBJ, OBJ)
    with pytest.raises(InputError, match="a link"):
        take(tmp_path / "some.7z", tmp_path / "in")


def test_too_large_a_member_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = seven_zip(tmp_path / "some.7z", FILES)
    monkeypatch.setattr(archive, "MEMBER_LIMIT", len(FILES[OBJ]) - 1)
    with pytest.raises(InputError, match=f"{OBJ}' of {len(FILES[OBJ])} bytes"):
        take(path, tmp_path / "in")
    monkeypatch.setattr(archive, "MEMBER_LIMIT", max(map(len, FILES.values())))
    assert len(take(path, tmp_path / "in")) == 2


def test_an_archive_that_unpacks_to_too_much_is_refused(tmp_path: Path) -> None:
    path = seven_zip(tmp_path / "bomb.7z", {**FILES, "zeros": bytes(archive.ARCHIVE_LIMIT)})
    with pytest.raises(InputError, match="would unpack to"):
        take(path, tmp_path / "in")
    assert not (tmp_path / "in").exists()


def test_a_damaged_archive_is_named_and_leaves_nothing(tmp_path: Path) -> None:
    whole = seven_zip(tmp_path / "whole.7z", FILES).read_bytes()
    middle = bytes([whole[60] ^ 255])
    damaged = {
        "empty": b"",
        "cut": whole[: len(whole) // 2],
        "short": whole[:20],
        "text": b"<html>" * 100,
        "flipped": whole[:60] + middle + whole[61:],
        "header": whole[:-5] + bytes([whole[-5] ^ 255]) + whole[-4:],
    }
    for name, data in damaged.items():
        path = tmp_path / f"{name}.7z"
        path.write_bytes(data)
        with pytest.raises(InputError, match=f"{name}.7z.*download it again") as refused:
            take(path, tmp_path / "in")
        assert "\n" not in str(refused.value)
        assert list((tmp_path / "in").rglob("*")) == []


def test_a_full_disk_while_unpacking(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = seven_zip(tmp_path / "some.7z", FILES)

    def begin(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(archive._Writers, "begin", begin)
    with pytest.raises(InputError, match="the disk is full"):
        take(path, tmp_path / "in")


def test_without_the_7z_reader_the_line_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(archive.importlib.util, "find_spec", lambda _: None)
    with pytest.raises(InputError, match=r"pip install.*\[abc\]"):
        take(tmp_path / "some.7z", tmp_path)


# Shapes


def test_extracted_files_become_a_shape_in_the_catalogues_unit(tmp_path: Path) -> None:
    (status, detail), *_ = outcomes(tmp_path / "root", filled(tmp_path / "abc" / "obj" / "00000007")).values()
    assert status == preparation.DONE
    assert "6 patches" in detail
    assert "times 1000" in detail
    assert_box_is_prepared(tmp_path / "root")
    loaded = shapes.load(NAME, abc_root=tmp_path / "root", labels="brep")
    assert loaded.watertight
    assert sorted(np.unique(loaded.mesh.labels, return_counts=True)[1]) == [2] * 6


@NEEDS_RAW
@pytest.mark.parametrize("name", ["abc_0015", "abc_0033"])
def test_a_distributed_obj_becomes_the_catalogues_own_mesh(tmp_path: Path, name: str) -> None:
    status, detail = outcomes(tmp_path, RAW, names=(name,))[name]
    assert (status, detail.split(": ")[-1]) == (preparation.DONE, "the catalogue's own mesh")
    for file in ("mesh.ply", "patches.npy"):
        assert (tmp_path / name / file).read_bytes() == (ABC / name / file).read_bytes()


@NEEDS_RAW
@NEEDS_READER
def test_a_distributed_step_file_becomes_the_catalogues_components(tmp_path: Path) -> None:
    names = ("abc_0008", "abc_0009")
    assert {each for each, _ in outcomes(tmp_path, RAW, names=names).values()} == {preparation.DONE}
    for name in names:
        made, own = (trimesh.load(root / name / "mesh.ply", process=False) for root in (tmp_path, ABC))
        assert made.is_watertight
        assert made.volume == pytest.approx(own.volume, rel=2e-3)
        assert np.allclose(made.bounds, own.bounds, atol=2e-3 * own.extents.max())
        patches, own_patches = (np.load(root / name / "patches.npy") for root in (tmp_path, ABC))
        areas = [np.sort(np.bincount(p, m.area_faces)) for p, m in ((patches, made), (own_patches, own))]
        assert np.allclose(*areas, rtol=5e-3)


@NEEDS_READER
@pytest.mark.parametrize("is_step", [False, True])
def test_a_component_is_known_by_its_size(tmp_path: Path, is_step: bool) -> None:
    entries = [abc.catalogue()[name] for name in ("abc_0009", "abc_0008")]
    sides = [np.array(entry.extents) / 1000 for entry in entries]
    corners = [((0, 0, 0), tuple(sides[0])), ((1, 0, 0), tuple(sides[1] + (1, 0, 0)))]
    bodies = [box(tuple(np.subtract(high, low)), low) for low, high in corners]
    mesh = trimesh.util.concatenate(bodies)
    patches = sides_of(mesh) + np.repeat([0, 6], 12)
    files = {
        ASSEMBLY.replace("_step_000.step", "_trimesh_000.obj"): obj_text(*bodies),
        ASSEMBLY.replace("_step_000.step", "_features_000.yml"): yml_text(patches),
    }
    if is_step:
        files = {ASSEMBLY: step_boxes(corners, METRE).encode()}
    found = outcomes(tmp_path, filled(tmp_path / "in", files), names=tuple(each.name for each in entries))
    assert {status for status, _ in found.values()} == {preparation.DONE}
    for entry in entries:
        mesh = trimesh.load(tmp_path / entry.name / "mesh.ply", process=False)
        assert np.allclose(mesh.extents, entry.extents, rtol=1e-5)
        assert len(mesh.faces) == 12
        assert np.bincount(np.load(tmp_path / entry.name / "patches.npy")).tolist() == [2] * 6


def test_where_no_component_fits_there_is_no_shape(tmp_path: Path) -> None:
    name = ASSEMBLY.replace("_step_000.step", "_trimesh_000.obj")
    found = outcomes(
        tmp_path,
        filled(tmp_path / "in", {name: obj_text(box((1, 2, 3)), box((1, 1, 1), (5, 5, 5)))}),
        names=("abc_0008",),
    )
    assert found["abc_0008"][0] == preparation.FAILED
    assert "none of its 2 components" in found["abc_0008"][1]
    assert not (tmp_path / "abc_0008").exists()


@pytest.mark.parametrize("factor", [1.0, 1000.0, 0.001, 25.4, 1 / 25.4, 10.0, 0.1, 0.0254, 304.8])
def test_units_are_found_from_the_extents(factor: float) -> None:
    entry = abc.catalogue()[NAME]
    uneven = np.array(entry.extents) * (1.004, 0.996, 1.0) / factor
    assert convert.scale_to(entry, np.array([[1.0, 2, 3], np.add(uneven, (1, 2, 3))])) == pytest.approx(
        factor, rel=1e-7
    )
    assert convert.scale_to(entry, np.array([[0.0, 0, 0], uneven * 1.5])) is None
    assert convert.scale_to(entry, np.array([[0.0, 0, 0], uneven * (1.03, 1, 1)])) is None


def test_what_is_no_unit_is_left_as_it_is_with_a_warning(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    files = {OBJ: obj_text(box((3.0, 4.0, 5.0)))}
    status, detail = outcomes(tmp_path, filled(tmp_path / "in", files))[NAME]
    assert status == preparation.DONE
    assert "no patches" in detail
    assert "has sides 3 4 5, the catalogue says 182.097 182.04 25.4" in caplog.text
    assert np.allclose(trimesh.load(tmp_path / NAME / "mesh.ply").extents, (3, 4, 5))
    assert not (tmp_path / NAME / "patches.npy").exists()


def test_a_normalised_mesh_takes_the_catalogues_size(tmp_path: Path) -> None:
    entry = abc.catalogue()["abc_0050"]
    files = {f"{entry.abc_id}.obj": obj_text(box(tuple(np.array(entry.extents) * 37.7)))}
    assert outcomes(tmp_path, filled(tmp_path / "in", files), names=("abc_0050",))["abc_0050"][0] == preparation.DONE
    assert np.allclose(trimesh.load(tmp_path / "abc_0050" / "mesh.ply").extents, entry.extents, rtol=1e-5)


def test_an_stl_file_is_merged(tmp_path: Path) -> None:
    files = {OBJ.replace(".obj", ".stl"): MESH.export(file_type="stl")}
    assert outcomes(tmp_path, filled(tmp_path / "in", files))[NAME][0] == preparation.DONE
    mesh = trimesh.load(tmp_path / NAME / "mesh.ply", process=False)
    assert (len(mesh.vertices), len(mesh.faces), mesh.is_watertight) == (8, 12, True)
    assert mesh.volume == pytest.approx(MESH.volume * 1e9, rel=1e-5)


def test_files_of_another_document_are_not_the_model(tmp_path: Path) -> None:
    files = {OBJ.replace("b33a", "b33b"): FILES[OBJ]}
    status, detail = outcomes(tmp_path, filled(tmp_path / "in", files))[NAME]
    assert (status, MODEL in detail) == (preparation.ABSENT, True)


def test_one_bad_model_does_not_stop_the_others(tmp_path: Path) -> None:
    beyond = FILES[YML].replace(b"face_indices: [", b"face_indices: [12, ", 1)
    other = {f"{OTHER}_trimesh_001.obj": FILES[OBJ], f"{OTHER}_features_001.yml": beyond}
    found = outcomes(tmp_path, filled(tmp_path / "in", FILES | other), names=(OTHER_NAME, NAME))
    assert found[NAME][0] == preparation.DONE
    assert found[OTHER_NAME][0] == preparation.FAILED
    assert "names face 12, the mesh has 0..11" in found[OTHER_NAME][1]
    assert not (tmp_path / OTHER_NAME).exists()


def test_with_all_formats_there_the_preferred_one_is_taken(tmp_path: Path) -> None:
    entry = abc.catalogue()[NAME]
    files = FILES | {f"{MODEL}_step_000.step": step_boxes([((0, 0, 0), entry.extents)]).encode()}
    source = filled(tmp_path / "in", files)
    assert f"from {OBJ}" in outcomes(tmp_path / "a", source)[NAME][1]
    if NEEDS_READER.args[0] is False:
        assert ".step" in outcomes(tmp_path / "b", source, preferred="step")[NAME][1]


# The command


def test_from_two_archives_on_the_web_and_then_nothing_twice(
    server: Server, tmp_path: Path, run: Callable[..., SimpleNamespace], monkeypatch: pytest.MonkeyPatch
) -> None:
    served = [
        server.chunk(kind, seven_zip(tmp_path / f"{kind}.7z", {f"00000007/{name}": FILES[name]}))
        for kind, name in (("obj", OBJ), ("feat", YML))
    ]
    arguments = ("--format", "obj", "--urls", urls(tmp_path, *served), "--yes")
    assert run(*arguments).code == 0
    assert_box_is_prepared(tmp_path / "root")
    assert len(server.ranges) == 2
    before = (tmp_path / "root" / NAME / "mesh.ply").stat().st_mtime_ns
    monkeypatch.setattr(archive, "extract", None)
    monkeypatch.setattr(convert, "write", None)
    again = run(*arguments)
    assert (again.code, len(server.ranges)) == (0, 2)
    assert "already there" in again.text
    assert (tmp_path / "root" / NAME / "mesh.ply").stat().st_mtime_ns == before


def test_an_interrupted_run_goes_on(
    server: Server, tmp_path: Path, run: Callable[..., SimpleNamespace], monkeypatch: pytest.MonkeyPatch
) -> None:
    served = [server.chunk(k, seven_zip(tmp_path / f"{k}.7z", FILES)) for k in ("obj", "feat")]
    arguments = ("--format", "obj", "--urls", urls(tmp_path, *served), "--yes")
    begun: list[str] = []
    begin = archive._Writers.begin

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    def counted(self: archive._Writers, name: str) -> object:
        begun.append(name)
        if len(begun) == 2:
            interrupted()
        return begin(self, name)

    monkeypatch.setattr(archive._Writers, "begin", counted)
    stopped = run(*arguments)
    assert (stopped.code, begun) == (130, [OBJ, YML])
    assert "goes on from here" in stopped.text
    with monkeypatch.context() as patched:
        patched.setattr(convert, "_write_whole", interrupted)
        assert run(*arguments).code == 130
    assert begun == [OBJ, YML, YML]
    assert not preparation.is_prepared(NAME, tmp_path / "root")
    assert run(*arguments).code == 0
    assert (begun, len(server.ranges)) == ([OBJ, YML, YML], 2)
    assert_box_is_prepared(tmp_path / "root")
    assert not list((tmp_path / "root").rglob("*.part"))


def test_local_archives_need_no_web(tmp_path: Path, run: Callable[..., SimpleNamespace]) -> None:
    filled(tmp_path / "in", {})
    seven_zip(tmp_path / "in" / "abc_0000_obj_v00.7z", {OBJ: FILES[OBJ]})
    seven_zip(tmp_path / "in" / "abc_0000_feat_v00.7z", {YML: FILES[YML]})
    (tmp_path / "in" / "abc_0001_obj_v00.7z").write_bytes(b"of another chunk: not opened")
    (tmp_path / "in" / "abc_0000_meta_v00.7z").write_bytes(b"of no use: not opened")
    assert run("--from", tmp_path / "in").code == 0
    assert_box_is_prepared(tmp_path / "root")


@NEEDS_RAW
def test_an_archive_of_any_name_can_be_named(tmp_path: Path, run: Callable[..., SimpleNamespace]) -> None:
    stem = "00000655_d87d11d9c3ca4ee5a88797ae"
    real = {f"00000655/{path.name}": path.read_bytes() for path in RAW.glob(f"{stem}_*")}
    assert run("--from", seven_zip(tmp_path / "mine.7z", real), shape="abc_0015").code == 0
    assert (tmp_path / "root/abc_0015/mesh.ply").read_bytes() == (ABC / "abc_0015/mesh.ply").read_bytes()


def test_a_damaged_local_archive_is_one_line(tmp_path: Path, run: Callable[..., SimpleNamespace]) -> None:
    (tmp_path / "abc_0000_obj_v00.7z").write_bytes(b"")
    failed = run("--from", tmp_path)
    assert failed.code == 2
    assert len(failed.errors) == 1
    assert "abc_0000_obj_v00.7z is empty" in failed.errors[0]


def test_nothing_found_and_wrong_arguments_are_one_line(tmp_path: Path, run: Callable[..., SimpleNamespace]) -> None:
    (tmp_path / "x.zip").write_bytes(b"")
    cases = [
        (("--from", tmp_path / "nowhere"), "does not exist"),
        (("--from", tmp_path / "x.zip"), "neither a folder nor a 7z"),
        (("--from", filled(tmp_path / "hollow", {})), "no shape could be prepared"),
        (("--urls", tmp_path / "nowhere"), "cannot be read"),
        (("--shapes", "abc_0099"), "unknown shape 'abc_0099'"),
    ]
    for arguments, said in cases:
        failed = run(*arguments)
        assert (failed.code, len(failed.errors)) == (2, 1)
        assert said in failed.errors[0]


def test_the_download_is_shown_and_confirmed(
    server: Server, tmp_path: Path, run: Callable[..., SimpleNamespace], monkeypatch: pytest.MonkeyPatch
) -> None:
    served = server.chunk("step", seven_zip(tmp_path / "step.7z", {"a.txt": b"x"}))
    arguments = ("--urls", urls(tmp_path, served))
    answers: list[str] = []
    monkeypatch.setattr("builtins.input", lambda _: answers.pop())
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(isatty=lambda: False))
    refused = run(*arguments)
    assert refused.code == 2
    assert "add --yes" in refused.errors[0]
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(isatty=lambda: True))
    answers.append("")
    refused = run(*arguments)
    assert (refused.code, len(refused.errors)) == (2, 1)
    assert "abc_0000_step_v00.7z" in refused.text
    assert f"To download: {served.bytes} bytes" in refused.text
    assert server.ranges == []
    answers.append("y")
    assert run(*arguments).code == 2  # the archive has nothing of use
    assert server.ranges == [None]


def test_a_chunk_for_one_shape_is_not_loaded_unasked(
    server: Server, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    served = server.chunk("step", seven_zip(tmp_path / "step.7z", {"a.txt": b"x"}))
    words = ["prepare", "--root", str(tmp_path / "root"), "--urls", str(urls(tmp_path, served)), "--yes"]
    assert command.main(words) == 2
    assert "abc_0050 alone needs chunk 0001: --shapes abc_0050 gets it" in caplog.text
    assert command.main([*words, "--shapes", "abc_0050"]) == 2
    assert "no address of abc_0001_step_v00.7z is known" in caplog.text


def test_the_command_itself(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "jointsdf.shapes.abc", "prepare", "--root", str(tmp_path / "root")]
    done = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stdout == ""
    last = done.stderr.splitlines()[-1]
    assert last == "error: a download of 1.6 GB is to be confirmed, and this is no terminal: add --yes"
    assert not re.search("Traceback|Warning", done.stderr)
    assert not (tmp_path / "root").exists()
