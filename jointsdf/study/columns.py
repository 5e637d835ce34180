"""Which metrics the tables show, and how: header, digits, which end is better."""

from dataclasses import dataclass

from jointsdf.study.latex import Goal


@dataclass(frozen=True)
class Column:
    """A metric of a table: its name in the rows, LaTeX header, printed digits, and which end is better."""

    metric: str
    header: str
    digits: int
    goal: Goal


RECONSTRUCTION = (
    Column("cd_l1", r"CD$_{L1}$ ($\times 10^{-2}$) $\downarrow$", 3, "low"),
    Column("cd_l1_floor", r"CD$_{L1}$ floor", 3, "none"),
    Column("cd_l1_over_floor", r"CD$_{L1}$/floor $\downarrow$", 2, "low"),
    Column("cd_l2", r"CD$_{L2}$ ($\times 10^{-2}$) $\downarrow$", 4, "low"),
    Column("nc", r"NC $\uparrow$", 3, "high"),
    Column("f1", r"F1 $\uparrow$", 3, "high"),
    Column("surface_p99", r"Surface p99 $\downarrow$", 4, "low"),
    Column("components", r"Components", 1, "none"),
)
SEGMENTATION = (
    Column("miou", r"mIoU $\uparrow$", 3, "high"),
    Column("acc", r"Acc. $\uparrow$", 3, "high"),
    Column("consistency", r"Consistency $\uparrow$", 3, "high"),
    Column("miou_exact", r"mIoU exact $\uparrow$", 3, "high"),
    Column("acc_exact", r"Acc. exact $\uparrow$", 3, "high"),
    Column("boundary_f1", r"Boundary F1 $\uparrow$", 3, "high"),
)
