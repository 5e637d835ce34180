"""glTF files made by hand and by an independent writer, and damaged ones."""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from gltf_files import GltfFile, pack
from mesh_files import BOX

from jointsdf.errors import InputError
from jointsdf.geometry.topology import signed_volume
from jointsdf.shapes.readers.file_mesh import FileMesh
from jointsdf.shapes.readers.gltf import read_gltf
from jointsdf.shapes.readers.mesh_file import content_sha256, read_mesh
from jointsdf.values import Unit

CORNERS = BOX.vertices.astype(np.float32)  # a box of 2 x 3 x 4 about (5, 6, 7)
FACES = BOX.faces.astype(np.uint8)
HALF_TURN_X = [1.0, 0, 0, 0]
QUARTER_TURN_Z = [0, 0, 0.5**0.5, 0.5**0.5]


def read(data: bytes | GltfFile, path: Path = Path("a.glb")) -> FileMesh:
    return read_gltf(path, data.glb() if isinstance(data, GltfFile) else data)


def placed(*nodes: dict[str, Any], **document: Any) -> GltfFile:
    """The box, placed by some root nodes."""
    file = GltfFile(**document)
    file.mesh(file.primitive(CORNERS, FACES))
    for node in nodes:
        file.node(**{"mesh": 0} | node)
    return file


def moved_corner() -> GltfFile:
    """The box with one of its numbers changed."""
    file = placed({})
    file.binary[0] ^= 1
    return file


def box_bounds(mesh: FileMesh) -> list[float]:
    return np.concatenate([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)]).tolist()


BOUNDS = {
    "as it is": ({}, [4, 4.5, 5, 6, 7.5, 9], 24),
    "moved": ({"translation": [-5, -6, -7]}, [-1, -1.5, -2, 1, 1.5, 2], 24),
    "scaled": ({"scale": [2, 1, 0.5]}, [8, 4.5, 2.5, 12, 7.5, 4.5], 24),
    "turned": ({"rotation": QUARTER_TURN_Z}, [-7.5, 4, 5, -4.5, 6, 9], 24),
    "turned by a quaternion of length 3": ({"rotation": [3.0, 0, 0, 0]}, [4, -7.5, -9, 6, -4.5, -5], 24),
    "scaled, then turned, then moved": (
        {"scale": [1, 2, 1], "rotation": QUARTER_TURN_Z, "translation": [0, 0, 1]}, [-15, 4, 6, -9, 6, 10], 48
    ),
    "mirrored": ({"scale": [-1, 1, 1]}, [-6, 4.5, 5, -4, 7.5, 9], 24),
    "mirrored by a matrix": (
        {"matrix": [0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 10, 0, 0, 1]}, [14.5, 4, 5, 17.5, 6, 9], 24
    ),
    "mirrored twice": ({"scale": [-1, -2, 1]}, [-6, -15, 5, -4, -9, 9], 48),
}  # fmt: skip


@pytest.mark.parametrize("case", BOUNDS)
def test_nodes_place_their_mesh_and_keep_its_outside(case: str) -> None:
    node, bounds, volume = BOUNDS[case]
    mesh = read(placed(node))
    np.testing.assert_allclose(box_bounds(mesh), bounds, atol=1e-12)
    assert signed_volume(mesh.vertices, mesh.faces) == pytest.approx(volume)
    assert mesh.unit == Unit("m", 1.0)
    assert mesh.polygons is None


def test_nested_nodes_mirrored_and_scaled() -> None:
    file = placed()
    leaf = file.node(root=False, mesh=0, scale=[1, -1, 1])
    middle = file.node(root=False, children=[leaf], rotation=HALF_TURN_X, name="arm")
    file.node(children=[middle], scale=[10, 10, 10], translation=[1, 0, 0])
    mesh = read(file)
    np.testing.assert_allclose(box_bounds(mesh), [41, 45, -90, 61, 75, -50], atol=1e-12)
    assert signed_volume(mesh.vertices, mesh.faces) == pytest.approx(24_000)


def test_what_a_scale_of_zero_flattens_is_left_out(caplog: pytest.LogCaptureFixture) -> None:
    mesh = read(placed({}, {"scale": [0, 1, 1]}, {"scale": [0, 0, 0]}))
    assert (len(mesh.faces), signed_volume(mesh.vertices, mesh.faces)) == (12, pytest.approx(24))
    assert "2 nodes that flatten their mesh by a scale of 0 are left out" in caplog.text


def test_order_is_by_mesh_then_primitive_then_node() -> None:
    file = GltfFile()
    for shift in (0, 100):
        parts = [file.primitive(CORNERS + np.float32([shift + at, 0, 0]), FACES) for at in (0, 10)]
        file.mesh(*parts, name="same")
    file.node(mesh=1, name="second")
    child = file.node(root=False, mesh=0)
    file.node(children=[child], name="first", translation=[1000, 0, 0])
    file.node(mesh=0, name="third")
    mesh = read(file)
    centres = mesh.vertices[mesh.faces].mean(axis=1).reshape(6, 12, 3).mean(axis=1)[:, 0]
    np.testing.assert_allclose(centres, [1005, 5, 1015, 15, 105, 115], rtol=1e-6)
    expected = {"node": [0, 1, 0, 1, 2, 2], "mesh": [0, 0, 0, 0, 1, 1]}
    assert {name: each.values[::12].tolist() for name, each in mesh.columns.items()} == expected
    assert not any(each.are_ids for each in mesh.columns.values())


def test_an_independent_writer_agrees() -> None:
    scene = trimesh.Scene()
    turn = trimesh.transformations.rotation_matrix(0.7, [1, 2, 3])
    first = scene.add_geometry(trimesh.creation.icosphere(1), transform=turn, node_name="a")
    scene.add_geometry(trimesh.creation.box((1, 2, 3)), transform=turn, node_name="b", parent_node_name=first)
    scene.add_geometry(trimesh.creation.cylinder(1, 3), node_name="c")
    data = scene.export(file_type="glb")
    mesh, other = read(data), scene.to_geometry()
    np.testing.assert_allclose(mesh.vertices[mesh.faces], other.triangles, atol=1e-6)
    assert np.unique(mesh.columns["node"].values).tolist() == [0, 1, 2]


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.uint32, None])
@pytest.mark.parametrize("padding", [0, 4])
def test_indices_of_every_type_and_strides(kind: type | None, padding: int) -> None:
    file = GltfFile()
    positions = CORNERS if kind else CORNERS[FACES.ravel()]
    primitive: dict[str, Any] = {"attributes": {"POSITION": file.accessor(positions, padding)}}
    if kind:
        primitive["indices"] = file.accessor(FACES.ravel().astype(kind))
    file.node(mesh=file.mesh(primitive))
    mesh = read(file)
    np.testing.assert_array_equal(mesh.vertices[mesh.faces], CORNERS[FACES].astype(float))


@pytest.mark.parametrize("kind", ["int8", "uint8", "int16", "uint16"])
@pytest.mark.parametrize("normalized", [True, False])
def test_quantised_positions(kind: str, normalized: bool) -> None:
    most = np.iinfo(kind).max
    low = -most if kind.startswith("i") else 0
    unit = np.where(trimesh.creation.box().vertices > 0, most, low).astype(kind)
    file = GltfFile(extensionsUsed=["KHR_mesh_quantization"], extensionsRequired=["KHR_mesh_quantization"])
    positions = file.accessor(unit, padding=unit.dtype.itemsize, normalized=normalized)
    mesh_index = file.mesh({"attributes": {"POSITION": positions}, "indices": file.accessor(FACES.ravel())})
    side = 2.0 if low else 1.0
    size = np.array([2, 3, 4]) / side / (1 if normalized else most)
    file.node(mesh=mesh_index, scale=size.tolist())
    mesh = read(file)
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), [2, 3, 4], rtol=1e-12)
    assert signed_volume(mesh.vertices, mesh.faces) == pytest.approx(24)


def test_the_least_normalised_integer_is_minus_one() -> None:
    file = GltfFile()
    positions = file.accessor(np.array([[-128, 0, 0], [127, 0, 0], [0, 127, -127]], dtype=np.int8), 1, normalized=True)
    file.node(mesh=file.mesh({"attributes": {"POSITION": positions}}))
    assert read(file).vertices.tolist() == [[-1, 0, 0], [1, 0, 0], [0, 1, -1]]


def test_strips_and_fans_keep_their_winding() -> None:
    ring = np.array([[1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 2, 0], [-1, 2, 0]], dtype=np.float32)
    zigzag = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 2, 0], [1, 2, 0]], dtype=np.float32)
    file = GltfFile()
    fan = file.primitive(np.float32([[0, 0, 0], *ring[:3].tolist()]), mode=6)
    strip = file.primitive(zigzag, np.array([0, 1, 2, 3, 3, 2, 2, 3, 4, 5], dtype=np.uint16), mode=5)
    file.node(mesh=file.mesh(fan, strip, file.primitive(ring, mode=1)))
    mesh = read(file)
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    areas = np.cross(b - a, c - a)[:, 2] / 2
    np.testing.assert_allclose(areas, [0.5] * 6)  # two of the fan, four of the strip: none that only leads on


def test_points_and_lines_are_left_out_with_a_warning(caplog: pytest.LogCaptureFixture) -> None:
    file = GltfFile()
    file.node(mesh=file.mesh(file.primitive(CORNERS, mode=0), file.primitive(CORNERS, FACES)))
    assert len(read(file).faces) == 12
    assert "1 primitives of points or lines are left out" in caplog.text


@pytest.mark.parametrize("based", [True, False])
def test_sparse_accessors(based: bool) -> None:
    file = GltfFile()
    wrong = CORNERS.copy()
    wrong[[1, 6]] = 99
    accessor = file.accessor(wrong)
    at = np.array([1, 6] if based else range(8), dtype=np.uint16)
    entry = file.document["accessors"][accessor]
    if not based:
        del entry["bufferView"]
    entry["sparse"] = {
        "count": len(at),
        "indices": {"bufferView": file.view(at.tobytes()), "componentType": 5123},
        "values": {"bufferView": file.view(CORNERS[at].tobytes())},
    }
    file.node(mesh=file.mesh({"attributes": {"POSITION": accessor}, "indices": file.accessor(FACES.ravel())}))
    mesh = read(file)
    np.testing.assert_array_equal(mesh.vertices[mesh.faces], CORNERS[FACES].astype(float))


def test_buffers_in_the_text_and_beside_it(tmp_path: Path) -> None:
    right = read(placed({}))
    file = placed({})
    (tmp_path / "sub").mkdir()
    for name, uri in (("a b.bin", "a%20b.bin"), ("sub/ü.bin", "sub/%C3%BC.bin")):
        (tmp_path / name).write_bytes(file.binary)
        np.testing.assert_array_equal(read(file.gltf(uri), tmp_path / "a.gltf").vertices, right.vertices)
    np.testing.assert_array_equal(read(file.gltf()).vertices, right.vertices)
    np.testing.assert_array_equal(read(b"\xef\xbb\xbf" + file.gltf()).faces, right.faces)


def test_the_hash_covers_a_buffer_beside_the_file(tmp_path: Path) -> None:
    hashes = []
    for file in (placed({}), placed({}), moved_corner()):
        (tmp_path / "a.bin").write_bytes(file.binary)
        (tmp_path / "a.gltf").write_bytes(placed({}).gltf("a.bin"))
        hashes.append(read_mesh(tmp_path / "a.gltf").sha256)
        assert content_sha256(tmp_path / "a.gltf", placed({}).gltf("a.bin")) == hashes[-1]
    assert hashes[0] == hashes[1] != hashes[2]
    (tmp_path / "a.glb").write_bytes(placed({}).glb())
    assert read_mesh(tmp_path / "a.glb").sha256 == hashlib.sha256(placed({}).glb()).hexdigest()


@pytest.mark.parametrize(
    "uri", ["/etc/passwd", "../a.bin", "b/../../a.bin", "file:///a.bin", "http://x/a.bin", "C:\\a.bin", "%2e%2e/a.bin"]
)
def test_no_file_outside_the_folder_is_opened(tmp_path: Path, uri: str) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    (tmp_path / "a.bin").write_bytes(placed({}).binary)
    with pytest.raises(InputError, match="put the file beside it"):
        read(placed({}).gltf(uri), folder / "a.gltf")


def test_materials_and_colours(tmp_path: Path) -> None:
    file = GltfFile(materials=[{"name": "steel"}, {"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0, 0, 1]}}])
    red, blue = [255, 0, 0, 255], [0, 0, 255, 255]
    painted = file.primitive(CORNERS[:3], material=0)
    painted["attributes"]["COLOR_0"] = file.accessor(np.array([red, blue, blue], dtype=np.uint8), normalized=True)
    pieces = [file.primitive(CORNERS[:3], material=each) for each in (1, 0, 1)]
    file.node(mesh=file.mesh(*pieces, painted, file.primitive(CORNERS[:3])))
    columns = read(file, tmp_path / "a.glb").columns
    assert columns["material"].values.tolist() == [0, 1, 0, 1, 2]
    assert columns["colour"].values.tolist() == [0, 1, 0, 2, 1]
    assert not columns["colour"].are_ids


def test_a_file_of_ours_gives_labels_and_its_own_frame() -> None:
    to_metres = [0.001, 0, 0, 0, 0, 0, -0.001, 0, 0, 0.001, 0, 0, 0, 0, 0, 1]
    file = placed()
    parts = [file.node(root=False, mesh=0, name=name) for name in ("part_12", "unlabelled", "part_0")]
    root = file.node(name="file_units", matrix=to_metres, children=parts)
    written = {"unit": "mm", "metres": 0.001, "known": True}
    file.document["asset"]["extras"] = {"jointsdf": written}
    mesh = read(file)
    assert box_bounds(mesh) == [4, 4.5, 5, 6, 7.5, 9]
    assert (mesh.unit, mesh.up) == (Unit("mm", 0.001, True), "z")
    assert mesh.columns["label"].values.tolist() == [12] * 12 + [-1] * 12 + [0] * 12
    assert mesh.columns["label"].are_ids
    file.document["asset"]["extras"] = {"jointsdf": written | {"up": "y"}}
    assert read(file).up == "y"
    damages = [{"metres": "1"}, {"metres": -1}, {"metres": True}, {"known": 1}]
    for damage in (*damages, *({"unit": name} for name in (None, "", "mm\nend_header", "m m", "m" * 25))):
        file.document["asset"]["extras"] = {"jointsdf": written | damage}
        np.testing.assert_allclose(box_bounds(read(file)), [0.004, 0.005, -0.0075, 0.006, 0.009, -0.0045])
        assert (read(file).unit, read(file).up) == (Unit("m", 1.0), "y")
    file.document["asset"]["extras"] = {"jointsdf": written}
    file.document["nodes"][root]["name"] = "world"
    assert read(file).unit == Unit("m", 1.0)


@pytest.mark.parametrize("name", ["part_01", "part_", "part_1 ", "Part_1", "part_99999999999"])
def test_other_names_of_nodes_are_no_labels(name: str) -> None:
    assert "label" not in read(placed({"name": "part_1"}, {"name": name})).columns


def test_the_default_scene_is_read(caplog: pytest.LogCaptureFixture) -> None:
    file = placed({}, {"translation": [100, 0, 0]}, scenes=[{"nodes": []}, {"nodes": [1]}], scene=1)
    assert box_bounds(read(file))[0] == 104
    assert "of its 2 scenes only the default one is read" in caplog.text
    for key in ("scene", "scenes"):
        del file.document[key]
        if key == "scene":
            file.document["scenes"] = [{"nodes": [0]}]
            assert len(read(file).faces) == 12
    assert len(read(file).faces) == 24
    del file.document["nodes"]
    assert box_bounds(read(file)) == [4, 4.5, 5, 6, 7.5, 9]


def test_instances_of_the_extension() -> None:
    file = placed({"translation": [0, 0, 50]})
    moves = file.accessor(np.array([[0, 0, 0], [100, 0, 0]], dtype=np.float32))
    scales = file.accessor(np.array([[1, 1, 1], [-2, 1, 1]], dtype=np.float32))
    attributes = {"TRANSLATION": moves, "SCALE": scales}
    file.document["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    mesh = read(file)
    np.testing.assert_allclose(box_bounds(mesh), [4, 4.5, 55, 92, 7.5, 59])
    assert signed_volume(mesh.vertices, mesh.faces) == pytest.approx(24 + 48)


def test_skins_and_morph_targets_are_at_rest(caplog: pytest.LogCaptureFixture) -> None:
    file = placed({"skin": 0}, skins=[{"joints": [0]}])
    file.document["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": 0}]
    assert box_bounds(read(file)) == [4, 4.5, 5, 6, 7.5, 9]
    assert [record.message for record in caplog.records].count(
        "a.glb: skins and morph targets are not applied, the mesh is read at rest"
    ) == 1


def changed(*keys: str | int, to: Any) -> bytes:
    """The placed box with one value of its JSON changed."""
    file = placed({"translation": [0, 0, 0]})
    holder: Any = file.document
    for key in keys[:-1]:
        holder = holder[key]
    holder[keys[-1]] = to
    return file.glb()


def compressed(extension: str, required: bool) -> bytes:
    file = placed({}, extensionsUsed=[extension], **({"extensionsRequired": [extension]} if required else {}))
    del file.document["accessors"][0]["bufferView"]
    return file.glb()


def cycle() -> bytes:
    file = placed({"children": [1]})
    file.node(root=False, children=[0])
    return file.glb()


def shared_child() -> bytes:
    file = placed({"children": [2]}, {"children": [2]})
    file.node(root=False, mesh=0)
    return file.glb()


WHOLE = placed({}).glb()
BAD: dict[str, tuple[bytes, str]] = {
    "version 1": (pack(b"{}", version=1), "is glTF of version '1', only 2.0 is read"),
    "text of version 1": (b'{"asset": {"version": "1.0"}, "meshes": {}}', "is glTF of version '1.0'"),
    "header cut": (WHOLE[:10], "its header is cut"),
    "cut": (WHOLE[:-50], "is truncated: it declares"),
    "longer than it says": (WHOLE + b"abcd", "it declares"),
    "chunk beyond the end": (WHOLE[:12] + b"\xff\xff\xff\x7f" + WHOLE[16:], "goes beyond its end"),
    "no JSON": (WHOLE[:16] + b"TEXT" + WHOLE[20:], "has no JSON chunk"),
    "JSON cut": (placed({}).gltf()[:200], "its JSON is cut or damaged"),
    "noise": (bytes(range(256)), "it is neither binary glTF nor JSON"),
    "nested deep": (b"[" * 200_000, "nested too deep"),
    "a list": (b"[]", "its JSON is no object"),
    "huge count": (changed("accessors", 0, "count", to=4_000_000_000), "4000000000 elements need"),
    "huge sparse count": (
        changed("accessors", 0, to={"componentType": 5126, "type": "VEC3", "count": 4_000_000_000, "sparse": {}}),
        "has no data for its 4000000000 elements",
    ),
    "huge offset": (changed("bufferViews", 0, "byteOffset", to=10**12), "their buffer view has"),
    "negative offset": (changed("bufferViews", 0, "byteOffset", to=-4), "no integer of at least 0"),
    "count of text": (changed("accessors", 0, "count", to="8"), "count 8 is no integer"),
    "unknown component": (changed("accessors", 0, "componentType", to=5130), "componentType 5130 is unknown"),
    "two coordinates": (changed("accessors", 0, "type", to="VEC2"), "accessor 0 is VEC2, not VEC3"),
    "indices of floats": (changed("accessors", 1, "componentType", to=5126), "need 144 bytes"),
    "index out of range": (changed("accessors", 0, "count", to=7), "an index of accessor 1 is out of range 0..6"),
    "35 indices": (changed("accessors", 1, "count", to=35), "35 corners are no whole number of triangles"),
    "no such mesh": (changed("nodes", 0, "mesh", to=7), "meshes[7] does not exist, there are 1"),
    "no such node": (changed("scenes", 0, "nodes", to=[5]), "nodes[5] does not exist"),
    "no such scene": (changed("scene", to=3), "scenes[3] does not exist"),
    "nodes of numbers": (changed("nodes", to=[1, 2]), "nodes is no list of objects"),
    "zero quaternion": (changed("nodes", 0, "rotation", to=[0, 0, 0, 0]), "a rotation is no quaternion"),
    "matrix of 15": (changed("nodes", 0, "matrix", to=[1] * 15), "matrix is not 16 finite numbers"),
    "matrix of perspective": (changed("nodes", 0, "matrix", to=[1] * 16), "is not affine"),
    "infinite translation": (changed("nodes", 0, "translation", to=[np.inf, 0, 0]), "not 3 finite numbers"),
    "huge integer": (changed("nodes", 0, "translation", to=[10**400, 0, 0]), "cannot be read as glb"),
    "cycle": (cycle(), "is in a cycle"),
    "shared child": (shared_child(), "node 2 is in a cycle, or is the child of two nodes"),
    "data URI not base64": (placed({}).gltf("data:;base64,@@@"), "cannot be read as glb"),
    "missing file": (placed({}).gltf("no.bin"), "needs 'no.bin' beside it"),
    "buffer cut": (placed({}).gltf("data:;base64,AAAA"), "is truncated: buffer 0 declares"),
    "Draco": (compressed("KHR_draco_mesh_compression", True), "KHR_draco_mesh_compression, which is not read"),
    "meshopt": (compressed("EXT_meshopt_compression", True), "EXT_meshopt_compression, which is not read"),
    "Draco, not required": (compressed("KHR_draco_mesh_compression", False), "export it without compression"),
    "unknown extension": (placed({}, extensionsRequired=["X_y"]).glb(), "glTF extension X_y, which is not read"),
    "no mesh in the scene": (placed().glb(), "its scene places no mesh"),
    "points": (changed("meshes", 0, "primitives", 0, "mode", to=0), "its scene holds only points or lines"),
}


@pytest.mark.parametrize("case", BAD)
def test_damage_is_one_line_that_names_the_file(case: str) -> None:
    data, message = BAD[case]
    with pytest.raises(InputError) as caught:
        read(data)
    assert message in str(caught.value)
    assert "a.glb" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_extensions_of_looks_do_no_harm() -> None:
    looks = ["KHR_materials_unlit", "KHR_texture_transform", "EXT_texture_webp", "KHR_lights_punctual"]
    assert len(read(placed({}, extensionsUsed=looks, extensionsRequired=looks)).faces) == 12


def test_too_many_instances_are_refused_before_they_fill_the_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("jointsdf.shapes.readers.gltf.MOST_TRIANGLES", 100)
    assert len(read(placed(*[{}] * 8)).faces) == 96
    with pytest.raises(InputError, match="places more than 100 triangles"):
        read(placed(*[{}] * 9))


def read_or_refuse(data: bytes) -> FileMesh | None:
    """The mesh; None where it is refused in one line."""
    try:
        return read(data)
    except InputError as error:
        return None if "\n" not in str(error) else pytest.fail(str(error))


def test_flipped_bits_give_a_mesh_or_one_line() -> None:
    rng = np.random.default_rng(0)
    for _ in range(400):
        data = bytearray(WHOLE)
        data[rng.integers(len(data))] ^= 1 << int(rng.integers(8))
        mesh = read_or_refuse(bytes(data))
        assert mesh is None or (len(mesh.faces) <= 12 and mesh.faces.max() < len(mesh.vertices))


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Keys that lead to each value within a JSON document."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [path] * bool(path) + [each for key, inner in items for each in places(inner, (*path, key))]


def test_values_of_wrong_types_give_a_mesh_or_one_line() -> None:
    for keys in places(placed({"translation": [1, 2, 3]}).document):
        for value in (None, True, -1, 1.5, "x", [], {}, [{}], {"a": 1}, 10**30):
            mesh = read_or_refuse(changed(*keys, to=value))
            assert mesh is None or len(mesh.faces) <= 12
