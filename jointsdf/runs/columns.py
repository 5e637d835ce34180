"""Names of the columns of flat result rows, and which of them a row may give its own entries."""

from collections.abc import Collection
from functools import lru_cache

RUN = ["study", "variant", "recipe", "protocol", "head", "shape", "seed"]
FACTS = ["source", "label_kind", "status", "num_parts", "steps"]
DERIVED = {  # from a metric and its reference
    "cd_l1_over_floor": ("cd_l1", "cd_l1_floor"),
    "nc_minus_floor": ("nc", "nc_floor"),
    "f1_over_floor": ("f1", "f1_floor"),
    "miou_minus_floor": ("miou", "miou_floor"),
    "acc_minus_floor": ("acc", "acc_floor"),
    "consistency_minus_floor": ("consistency", "consistency_floor"),
    "miou_exact_over_ceiling": ("miou_exact", "miou_exact_ceiling"),
    "edge_f1_fine_over_ceiling": ("edge_f1_fine", "edge_f1_fine_ceiling"),
    "pieces_right": ("components", "components_gt"),
    "euler_right": ("euler", "euler_gt"),
    "parts_right": ("parts_pred", "parts_gt"),
}
MEMORY, SCHEMA_COLUMN = "peak_memory_mb", "schema"  # between metrics and sizes, and between these and provenance
SECONDS = "seconds_"
COUNTS = "counts."  # before a count that has a metric's name
PROVENANCE = "provenance."  # before a fact that has a metric's or a count's name
READ_FACTS = (  # those that tables, captions and groups read by name
    *("label_provider", "mesh_sha256", "config_hash", "settings_hash"),
    *("machine", "device", "threads", "resolution", "corruption"),
)
READ_COUNTS = ("parameters_trunk", "parameters_head")
CACHED = 4096  # names, which many rows share
LONGEST = 200  # characters of an entry's name
TAKEN = frozenset([*RUN, *FACTS, *DERIVED, MEMORY, SCHEMA_COLUMN, COUNTS[:-1], PROVENANCE[:-1]])


@lru_cache(CACHED)
def check_name(name: str) -> None:
    """Refuse names that no table can show.

    Raises:
        ValueError: It is refused.
    """
    if not name or len(name) > LONGEST or not name.isprintable():
        raise ValueError(f"a name has from 1 to {LONGEST} printable characters")


@lru_cache(CACHED)
def check_metric(name: str) -> None:
    """Refuse names of metrics that no table can show, or that are another column's.

    Raises:
        ValueError: It is refused.

    >>> check_metric("seed")
    Traceback (most recent call last):
    ValueError: it is the name of another column
    """
    _check_column(name, (*READ_COUNTS, *READ_FACTS))


@lru_cache(CACHED)
def check_count(name: str) -> None:
    """As `check_metric`, of counts.

    Raises:
        ValueError: It is refused.
    """
    _check_column(name, READ_FACTS)
    if "." in name:
        raise ValueError("a name has no dot")


@lru_cache(CACHED)
def check_fact(name: str) -> None:
    """As `check_metric`, of facts, whose own entries come after a dot.

    Raises:
        ValueError: It is refused.
    """
    _check_column(name)
    if "." in name:
        raise ValueError("a name has no dot")


def _check_column(name: str, others: Collection[str] = ()) -> None:
    check_name(name)
    if name in TAKEN or name in others or name.startswith((SECONDS, COUNTS, PROVENANCE)):
        raise ValueError("it is the name of another column")
