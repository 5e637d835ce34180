"""A mesh that needs labels, with their possible sources: what each provider takes."""

from dataclasses import dataclass
from pathlib import Path

from jaxtyping import Int
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.shapes.readers.file_mesh import FileMesh
from jointsdf.values import LabelledMesh

Labels = tuple[Int[ndarray, " f"], str]  # the part of each face, and the provider with its setting


@dataclass(frozen=True)
class UnlabelledShape:
    """A mesh that needs labels, and their possible sources.

    Attributes:
        name: Of the mesh in messages.
        file_mesh: The mesh in its file: label files follow its order.
        solid: The repaired mesh, with own labels or -1.
        source_faces: Index of each face of `solid` among those of `file_mesh`.
        path: The mesh file; None for a mesh without a file.
        patch_source: File of the B-rep patches, existing or not: a `.npy`, a features file, or the STEP file itself.
        patches: Of a STEP file's faces, in the order of `file_mesh`; None for any other mesh.
        known_as: Names that PartField may have given to the mesh.
        num_parts: Wanted number of parts, None to let the provider choose.
        usual_parts: Number of parts that the geometric provider chooses; None for the natural one.
        partfield_dir: PartField's output folder.
        needed: Whether missing patches are an error; otherwise the mesh stays unlabelled.
    """

    name: str
    file_mesh: FileMesh
    solid: LabelledMesh
    source_faces: Int[ndarray, " f"]
    path: Path | None = None
    patch_source: Path | None = None
    patches: Int[ndarray, " g"] | None = None
    known_as: tuple[str, ...] = ()
    num_parts: int | None = None
    usual_parts: int | None = None
    partfield_dir: Path | None = None
    needed: bool = True

    def refuse_count(self, why: str) -> None:
        """Refuse a wanted number of parts where there is no choice.

        Raises:
            InputError: A number of parts is wanted.
        """
        if self.num_parts is not None:
            raise InputError(f"num_parts={self.num_parts}: {why}; leave num_parts out, or give labels=geometric")
