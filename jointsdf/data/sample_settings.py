"""Settings of the training cloud and of the pool of known distances."""

from dataclasses import dataclass, field

from jointsdf.data.corruption import Corruption
from jointsdf.errors import InputError, require_integer, require_number, require_one_of

OF_THE_MESH = ("region_points", "crease_points", "part_points", "border_points")  # settings of further points
LEAST_POINTS = 100  # of the cloud: the 51st neighbour must exist, and the points must show a surface


@dataclass(frozen=True)
class SampleSettings:
    """Sizes of the cloud and the pool, and the source of distances.

    Attributes:
        cloud_size: Points of the training cloud.
        pool_size: Points with known signed distance; 0 where no term uses them.
        distances: Source of those distances and of the normals: `mesh`, exact; `cloud`, estimated from the uniform
            points of the cloud alone; `none`, for terms that use neither.
        pool_near: Share of the pool near the surface; the rest is uniform in the box.
        region_points: Points of the cloud spread over the smooth regions, beyond `cloud_size`.
        crease_points: Points of the cloud beside creases, beyond `cloud_size`.
        part_points: Points of the cloud drawn part by part, equally many of each, beyond `cloud_size`.
        border_points: Points of the cloud near part borders, beyond `cloud_size`.
        label_fraction: Share of the cloud that has its labels.
        denoise: Whether stray points are left out and noise is taken off before distances are estimated from a cloud.
        corruption: What the cloud suffers. Not with what comes from the mesh, which would tell what it hides.

    Raises:
        InputError: A value out of its range, or a corruption beside what comes from the mesh.
    """

    cloud_size: int
    pool_size: int
    distances: str = "mesh"
    pool_near: float = 0.5
    region_points: int = 0
    crease_points: int = 0
    part_points: int = 0
    border_points: int = 0
    label_fraction: float = 1.0
    denoise: bool = False
    corruption: Corruption = field(default_factory=Corruption)

    def __post_init__(self) -> None:
        """Check the ranges."""
        require_integer("data.cloud_size", self.cloud_size, LEAST_POINTS)
        for name in ("pool_size", *OF_THE_MESH):
            require_integer(f"data.{name}", getattr(self, name), 0)
        require_one_of("data.distances", self.distances, ("mesh", "cloud", "none"))
        require_number("data.pool_near", self.pool_near, 0, 1)
        require_number("data.label_fraction", self.label_fraction, 0, 1)
        if self.distances == "none" and self.pool_size:
            raise InputError(
                f"data.distances=none tells no distances to data.pool_size={self.pool_size} points: give "
                "data.distances=cloud, or a loss with weights.signed_distance=0"
            )
        if str(self.corruption):
            self._check_corruption()

    def _check_corruption(self) -> None:
        """Refuse what comes from the mesh, and more points than the cloud has."""
        why = f"data.corruption ({self.corruption}): the mesh would tell what it hides; "
        if self.distances == "mesh":
            raise InputError(f"{why}give recipe=points, or data.distances=cloud")
        for name in OF_THE_MESH:
            if number := getattr(self, name):
                raise InputError(f"{why}data.{name}={number} must be 0")
        if (count := self.corruption.count) is not None and count > self.cloud_size:
            raise InputError(f"data.corruption.count={count}: it is of the cloud's data.cloud_size={self.cloud_size}")
