"""Metrics of the tables: header, digits, better end."""

from dataclasses import dataclass

from jointsdf.study.tables.latex import Goal

ARROWS = {"low": r" $\downarrow$", "high": r" $\uparrow$", "none": ""}


@dataclass(frozen=True)
class Column:
    """A metric of a table.

    Attributes:
        metric: Its column in the rows.
        name: LaTeX.
        digits: Printed after the point.
        goal: The better end.
        unit: LaTeX, after the name in a header.
    """

    metric: str
    name: str
    digits: int
    goal: Goal
    unit: str = ""

    @property
    def header(self) -> str:
        """Name, unit, and an arrow towards the better end."""
        return self.name + self.unit + ARROWS[self.goal]


HUNDREDTHS = r" ($\times 10^{-2}$)"
CD_L1 = Column("cd_l1", "CD$_{L1}$", 3, "low", HUNDREDTHS)
CD_L2 = Column("cd_l2", "CD$_{L2}$", 4, "low", HUNDREDTHS)
CD_L1_OVER_FLOOR = Column("cd_l1_over_floor", "CD$_{L1}$/floor", 2, "low")
NC = Column("nc", "NC", 3, "high")
F1 = Column("f1", "F1", 3, "high")
SURFACE_P99 = Column("surface_p99", "Surface p99", 4, "low")
MIOU = Column("miou", "mIoU", 3, "high")
ACC = Column("acc", "Acc.", 3, "high")
CONSISTENCY = Column("consistency", "Consistency", 3, "high")
MIOU_EXACT = Column("miou_exact", "mIoU exact", 3, "high")
ACC_EXACT = Column("acc_exact", "Acc. exact", 3, "high")
BOUNDARY_F1 = Column("boundary_f1", "Boundary F1", 3, "high")
BOUNDARY_F1_FINE = Column("boundary_f1_fine", "Fine", 3, "high")
EDGE_F1_FINE = Column("edge_f1_fine", "Edge F1, fine", 3, "high")
SECONDS = Column("seconds_total", "Total", 0, "low", " (s)")
MEMORY = Column("peak_memory_mb", "Memory", 0, "low", " (MiB)")

RECONSTRUCTION = (
    CD_L1,
    Column("cd_l1_floor", r"CD$_{L1}$ floor", 3, "none"),
    CD_L1_OVER_FLOOR,
    CD_L2,
    NC,
    F1,
    SURFACE_P99,
    EDGE_F1_FINE,
    Column("components", "Components", 1, "none"),
)
SEGMENTATION = (MIOU, ACC, CONSISTENCY, MIOU_EXACT, ACC_EXACT, BOUNDARY_F1, BOUNDARY_F1_FINE)
DISTANCE = (
    Column("sdf_relative_mean", "Rel. error", 4, "low"),
    Column("sdf_relative_p99", "p99", 3, "low"),
    Column("sdf_ratio", "$f/d$", 3, "none"),
    Column("gradient_angle_median", r"$\angle$ ($^\circ$)", 1, "low"),
    Column("eikonal_error", "Eikonal", 3, "low"),
    Column("overshoot", "Overshoot", 4, "low"),
    Column("overshoot_b5", r"Overshoot, 5\,\%", 4, "low"),
    Column("sign_error", "Sign", 5, "low"),
    Column("sdf_error_mean_b1", r"Error, 1\,\%", 5, "low"),
)
EDGES = (
    EDGE_F1_FINE,
    Column("edge_f1", "Edge F1", 3, "high"),
    Column("edge_cd", "Edge CD", 3, "low", HUNDREDTHS),
    Column("crease_angle_error", r"$\angle$ ($^\circ$)", 1, "low"),
    Column("crease_length_ratio", "Length", 2, "none"),
    Column("false_crease_length", "False", 2, "low"),
    Column("crease_nc", "NC", 3, "high"),
    Column("flatness", "Flatness", 5, "low"),
    Column("crease_border_p99", "Border p99", 4, "low"),
    Column("crease_border_back_p99", "back", 4, "low"),
)
HELD_OUT = (
    Column("held_out_mean", "To surface", 5, "low"),
    Column("held_out_p99", "p99", 4, "low"),
    Column("to_cloud_mean", "To cloud", 5, "low"),
    Column("to_cloud_p99", "p99 to cloud", 4, "low"),
    Column("uncovered", "Uncovered", 4, "none"),
    Column("held_out_acc", "Acc.", 3, "high"),
    Column("held_out_miou", "mIoU", 3, "high"),
    Column("components", "Components", 1, "none"),
)
BY_PART_COUNT = (CD_L1, CD_L1_OVER_FLOOR, NC, F1, MIOU, ACC, MIOU_EXACT)
PAIRED = (CD_L1, CD_L1_OVER_FLOOR, NC, F1)
CONTRASTED = (CD_L1_OVER_FLOOR, SURFACE_P99, NC, F1, EDGE_F1_FINE, *SEGMENTATION)
AGAINST_PAPER = (CD_L1, CD_L2, NC, F1, MIOU, ACC, CONSISTENCY)
COST = (
    *(Column(f"seconds_{stage}", stage.capitalize(), 1, "low", " (s)") for stage in ("fit", "extract", "evaluate")),
    SECONDS,
    MEMORY,
    Column("parameters_trunk", "Trunk parameters", 0, "none"),
    Column("parameters_head", "Head parameters", 0, "none"),
)


@dataclass(frozen=True)
class Relation:
    """Reconstruction metrics that are correlated with segmentation metrics."""

    reconstruction: tuple[Column, ...]
    segmentation: tuple[Column, ...]


PAPER = Relation((CD_L1, NC, F1), (MIOU, ACC, CONSISTENCY))
NC_MINUS_FLOOR = Column("nc_minus_floor", r"NC $-$ floor", 3, "high")
F1_OVER_FLOOR = Column("f1_over_floor", "F1/floor", 3, "high")
WORST = (
    CD_L1,
    CD_L1_OVER_FLOOR,
    SURFACE_P99,
    NC,
    NC_MINUS_FLOOR,
    F1_OVER_FLOOR,
    Column("miou_minus_floor", r"mIoU $-$ floor", 3, "high"),
    Column("acc_minus_floor", r"Acc. $-$ floor", 3, "high"),
    Column("consistency_minus_floor", r"Consistency $-$ floor", 3, "high"),
    Column("miou_exact_over_ceiling", "mIoU exact/ceiling", 3, "high"),
    ACC_EXACT,
    BOUNDARY_F1,
    Column("edge_f1_fine_over_ceiling", "Edge F1, fine/ceiling", 3, "high"),
)
RIGHT = (
    Column("pieces_right", "Right number of pieces", 0, "high"),
    Column("euler_right", "Right Euler number", 0, "high"),
    Column("parts_right", "Right number of parts", 0, "high"),
)
# Raw cd_l1 ranks shapes by surface area; over its floor it ranks the error that the fit adds.
EXACT = Relation(
    (
        CD_L1_OVER_FLOOR,
        NC_MINUS_FLOOR,
        F1_OVER_FLOOR,
    ),
    (MIOU_EXACT, ACC_EXACT),
)
