"""Solids of the parts in a run's folder, where the config asks for them."""

import logging
from pathlib import Path

from omegaconf import DictConfig

from jointsdf.errors import InputError
from jointsdf.extraction.part_solids import field_part_solids
from jointsdf.model.field import JointField
from jointsdf.phases import tell
from jointsdf.values import LabelledMesh, Subject
from jointsdf.viewing.part_folder import FOLDER, write_parts

log = logging.getLogger(__name__)


def save_solids(cfg: DictConfig, folder: Path, shape: Subject, mesh: LabelledMesh, field: JointField) -> None:
    """Write a closed solid of each part, with `part_solids=ply` or `stl`; a surface that has none is logged.

    Args:
        cfg: The composed config.
        folder: The run folder.
        shape: Mesh or point cloud, whose unit and axis the files name.
        mesh: Extracted mesh, file frame.
        field: The fitted field.
    """
    if cfg.part_solids is None:
        return
    tell(facts="solids of the parts")
    try:
        write_parts(folder / FOLDER, field_part_solids(field, mesh), cfg.part_solids, shape.unit, shape.up)
    except InputError as error:  # a run is not lost for it
        log.warning("no %s/: %s", FOLDER, error)
