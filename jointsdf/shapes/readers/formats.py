"""Formats of mesh and CAD files: those that are read, and what to do about those that are not."""

from dataclasses import dataclass
from pathlib import Path

GZIP = ".gz"
READ = {
    "ply": "ply", "obj": "obj", "stl": "stl", "off": "off", "glb": "glb", "gltf": "gltf",
    "step": "step", "stp": "step", "p21": "step",
}  # fmt: skip
FORMATS = tuple(READ)  # suffixes, each also with .gz
POINTS = ("xyz", "xyzn", "pts", "asc", "pcd", "las", "laz")  # suffixes of files that hold nothing but points
SOME = "ply, xyz, csv, npy, pcd or las"  # formats of points
LISTED = f"{', '.join(FORMATS)} (also .gz)"

AS_STEP = "export it as STEP"
AS_MESH = "export it as PLY, OBJ or STL"
AS_SURFACE = "a mesh is needed: reconstruct its surface, or fit the points by shape=<file> recipe=points"
UNPACK = "unpack it and give the mesh file in it"
NO_MESH = "give a mesh or STEP file"


@dataclass(frozen=True)
class Unread:
    """A kind of file that is not read.

    Attributes:
        name: What it is.
        fix: What the user can do.
    """

    name: str
    fix: str


UNREAD = {
    "igs": Unread("an IGES file (surfaces)", AS_STEP),
    "sldprt": Unread("a SolidWorks file", AS_STEP),
    "catpart": Unread("a CATIA file", AS_STEP),
    "prt": Unread("a part of NX or Creo", AS_STEP),
    "asm": Unread("an assembly of Solid Edge or Creo", AS_STEP),
    "ipt": Unread("an Autodesk Inventor file", AS_STEP),
    "ole": Unread("a binary document, such as a SolidWorks or Inventor part", AS_STEP),
    "f3d": Unread("an Autodesk Fusion file", AS_STEP),
    "x_t": Unread("a Parasolid file", AS_STEP),
    "sat": Unread("an ACIS file", AS_STEP),
    "brep": Unread("an OpenCASCADE B-rep file", AS_STEP),
    "fcstd": Unread("a FreeCAD file", AS_STEP),
    "jt": Unread("a JT file", AS_STEP),
    "3dm": Unread("a Rhino file", AS_STEP),
    "dwg": Unread("an AutoCAD drawing (DWG)", AS_STEP),
    "dxf": Unread("a DXF drawing", AS_STEP),
    "scad": Unread("an OpenSCAD program", "render it and export it as STL or OFF"),
    "skp": Unread("a SketchUp file", AS_MESH),
    "3mf": Unread("a 3MF file", AS_MESH),
    "amf": Unread("an AMF file", AS_MESH),
    "fbx": Unread("an FBX file", AS_MESH),
    "dae": Unread("a Collada file", AS_MESH),
    "usd": Unread("a USD file", AS_MESH),
    "blend": Unread("a Blender file", AS_MESH),
    "3ds": Unread("a 3D Studio file", AS_MESH),
    "wrl": Unread("a VRML or X3D file", AS_MESH),
    "drc": Unread("a Draco file", AS_MESH),
    "vtk": Unread("a VTK file", AS_MESH),
    "msh": Unread("a gmsh file", "export its surface as STL or PLY"),
    "inp": Unread("an Abaqus input file", "export its surface as STL or PLY"),
    "bdf": Unread("a Nastran file", "export its surface as STL or PLY"),
    "xyz": Unread("a point cloud", AS_SURFACE),
    "e57": Unread("a point cloud in E57", "export it as PLY, PCD or LAS"),
    "zip": Unread("a zip archive", UNPACK),
    "7z": Unread("a 7z archive", UNPACK),
    "rar": Unread("a rar archive", UNPACK),
    "tar": Unread("a tar archive", UNPACK),
    "gz": Unread("compressed by gzip, which its name does not say", f"give its name the ending {GZIP}"),
    "bz2": Unread("compressed by bzip2, xz or zstd", UNPACK),
    "html": Unread("a web page, such as that of a failed download", "download the file again"),
    "lfs": Unread("a pointer of git-lfs in place of the file", "fetch it by git lfs pull"),
    "png": Unread("a picture", NO_MESH),
    "pdf": Unread("a PDF document", NO_MESH),
    "json": Unread("JSON, but no glTF", NO_MESH),
    "yml": Unread("YAML, such as an ABC features file", "give the mesh that it belongs to"),
    "npy": Unread("an array, not a mesh", f"{NO_MESH}; labels of its faces go to labels="),
    "csv": Unread("a table or text, not a mesh", NO_MESH),
    "mtl": Unread("a material library", "give the OBJ file that names it"),
    "utf16": Unread("text in UTF-16", "save it as UTF-8"),
}
CONTAINERS = ("zip", "ole", "gz", "bz2", "xyz", "csv")  # of which a file's name says more than its content
ALIASES = {
    "iges": "igs", "sldasm": "sldprt", "catproduct": "catpart", "iam": "ipt", "x_b": "x_t", "xmt_txt": "x_t",
    "sab": "sat", "brp": "brep", "usdz": "usd", "usda": "usd", "usdc": "usd", "x3d": "wrl", "vtp": "vtk", "vtu": "vtk",
    "nas": "bdf", "xyzc": "xyz", "pts": "xyz", "asc": "xyz", "pcd": "xyz", "las": "xyz", "laz": "xyz", "tgz": "tar",
    "xz": "bz2", "zst": "bz2", "htm": "html", "jpg": "png", "jpeg": "png", "gif": "png", "bmp": "png", "tif": "png",
    "tiff": "png", "webp": "png", "svg": "png", "yaml": "yml", "npz": "npy", "txt": "csv",
}  # fmt: skip


def format_of(path: Path) -> str:
    """The format that a file's name says, in any case: one of the values of `READ`, or "".

    >>> format_of(Path("Part.STP.gz"))
    'step'
    """
    return READ.get(suffix_of(path), "")


def unread_by_name(path: Path) -> Unread | None:
    """What a file that is not read is by its name; None where that says nothing."""
    suffix = suffix_of(path)
    return UNREAD.get(ALIASES.get(suffix, suffix))


def stem_of(path: Path) -> str:
    """The file's name without its suffix, nor that of a compression.

    >>> stem_of(Path("part.v2.stl.gz"))
    'part.v2'
    """
    return _uncompressed(path).stem


def suffix_of(path: Path) -> str:
    """The suffix in small letters without its point, below that of a compression."""
    return _uncompressed(path).suffix.lower().lstrip(".")


def _uncompressed(path: Path) -> Path:
    return path.with_suffix("") if path.suffix.lower() == GZIP else path
