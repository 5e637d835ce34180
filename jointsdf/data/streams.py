"""Random streams of a run's data: one of each purpose, a function of the seed alone."""

from numpy.random import Generator, Philox

from jointsdf.errors import require_integer

STEP_BITS = 48  # of a stream's key that hold the step; the purpose is above them
CLOUD, POOL, LABELS, STEPS, BORDERS, REGIONS, CREASES, PARTS, REFIT = range(9)
PLACES, RAYS, DENSITY, MISSING, COUNT, OUTLIERS, NOISE, FLIPS = range(16, 24)  # of corruptions
THIN = 24


def stream(seed: int, purpose: int, step: int = 0) -> Generator:
    """Counter-based generator (Philox: Salmon et al. 2011) of one purpose and step.

    It has no state to save between steps, and draws the same on every machine.

    Args:
        seed: Of the run.
        purpose: `CLOUD`, `POOL`, ...
        step: Training step, below 2^48.

    Raises:
        InputError: A negative seed.

    >>> stream(0, CLOUD).random() == stream(0, CLOUD).random() != stream(0, POOL).random()
    True
    """
    require_integer("seed", seed, 0)
    return Generator(Philox(key=[seed, (purpose << STEP_BITS) + step]))
