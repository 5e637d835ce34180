"""Recognition of a file's format by its first bytes ("magic numbers"), where they leave no doubt.

Sources: the formats' specifications, and the signatures in the database of file(1).
"""

import re

from jointsdf.shapes.readers.stl import is_whole_binary

HEAD = 1 << 16  # bytes that are looked at
MARK = b"\xef\xbb\xbf"  # of UTF-8
XML = rb"(?:<\?xml.*?\?>\s*)?(?:<!--.*?-->\s*|<!DOCTYPE.*?>\s*)*"
NUMBER = rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
SIGNATURES = {  # keys of READ and UNREAD
    "ply": rb"ply[ \t]*[\r\n]",
    "glb": rb"glTF",
    "step": rb"ISO-10303-21",
    "off": rb"(?:ST)?C?N?4?n?OFF(?:\s|\d)",
    "stl": rb"(?i:solid\b[^\r\n]*[\r\n\s]+facet\s+normal\s)",
    "skp": rb"\xff\xfe\xff\x0eS\x00k\x00e\x00t\x00c\x00h",
    "utf16": rb"\xff\xfe|\xfe\xff",
    "7z": rb"7z\xbc\xaf\x27\x1c",
    "rar": rb"Rar!\x1a\x07",
    "gz": rb"\x1f\x8b\x08",
    "bz2": rb"BZh\d1AY&SY|\xfd7zXZ\x00|\x28\xb5\x2f\xfd",
    "lfs": rb"version https://git-lfs\.github\.com/",
    "ole": rb"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",
    "x_t": rb"\*\*ABCDEFGHIJKLMNOPQRSTUVWXYZ|PS\x00\x00\x00",
    "sat": rb"ACIS BinaryFile|ASM BinaryFile|\d+ \d+ \d+ \d+\s+\d+ [^\r\n]*(?:ACIS|ASM) ",
    "brep": rb"DBRep_DrawableShape|CASCADE Topology",
    "jt": rb"Version \d+\.\d+ JT",
    "3dm": rb"3D Geometry File Format",
    "dwg": rb"AC10\d\d",
    "dxf": rb"(?:999\r?\n[^\r\n]*\r?\n\s*)*0\r?\n\s*SECTION|AutoCAD Binary DXF",
    "catpart": rb"V5_CFV2",
    "prt": rb"#UGC:2",
    "fbx": rb"Kaydara FBX Binary|; FBX \d",
    "blend": rb"BLENDER",
    "usd": rb"#usda |PXR-USDC",
    "wrl": rb"#VRML |" + XML + rb"<X3D\b",
    "amf": XML + rb"<amf\b",
    "dae": XML + rb"<COLLADA\b",
    "vtk": rb"# vtk DataFile|" + XML + rb"<VTKFile\b",
    "html": rb"(?i:" + XML + rb"<html\b)|(?i:<!doctype html)",
    "drc": rb"DRACO",
    "msh": rb"\$MeshFormat",
    "inp": rb"(?i:(?:\*\*[^\r\n]*\s+)*\*(?:heading|node|part)\b)",
    "xyz": rb"LASF|# \.PCD",
    "e57": rb"ASTM-E57",
    "png": rb"\x89PNG|\xff\xd8\xff|GIF8|II\*\x00|MM\x00\*|RIFF....WEBP",
    "pdf": rb"%PDF-",
    "npy": rb"\x93NUMPY",
}
PATTERNS = {key: re.compile(pattern, re.DOTALL) for key, pattern in SIGNATURES.items()}
IGES = re.compile(rb"[^\r\n]{72}S[ 0]*1[\r\n]")
BULK = re.compile(rb"(?m)^BEGIN BULK")
VERTEX = re.compile(rb"(?m)^[ \t]*v(?:[ \t]+" + NUMBER + rb"){3}")
FACE = re.compile(rb"(?m)^[ \t]*f[ \t]+-?\d")
PACKED = {
    "3mf": b"3D/3dmodel.model",
    "fcstd": b"Document.xml",
    "f3d": b"FusionAssetName",
    "usd": b".usd",
    "npy": b".npy",
}


def recognise(data: bytes) -> str:
    """Recognise the format of a file's content.

    Args:
        data: The content, not compressed.

    Returns:
        The format, one of the values of `READ`; or a key of `UNREAD`; or "" where the content may be anything.
    """
    if is_whole_binary(data):
        return "stl"
    head = data[:HEAD]
    if head.startswith(b"PK\x03\x04"):
        return next((key for key, member in PACKED.items() if member in head), "zip")
    words = head.removeprefix(MARK).lstrip(b" \t\r\n")
    if words.startswith(b"{"):
        return "gltf" if b'"asset"' in data and re.search(rb'"(?:meshes|scenes|nodes)"', data) else "json"
    found = next((key for key, pattern in PATTERNS.items() if pattern.match(words)), "")
    if found:
        return found
    if IGES.match(head):
        return "igs"
    if BULK.search(head):
        return "bdf"
    return "obj" if VERTEX.search(head) and FACE.search(data) else ""
