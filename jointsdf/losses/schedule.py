"""Schedule of a term's weight over the run: constant, linear, quintic or stepwise between knots."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

from jointsdf.errors import InputError

FORMS = ("constant", "linear", "quintic", "step")


@dataclass(frozen=True)
class Schedule:
    """A factor on a term's weight, as a function of the share of steps done.

    Attributes:
        form: `constant`: 1 throughout. From one knot to the next, `linear` interpolates, `quintic` falls fast and
            then slowly, by 1 - (1 - s)^5, and `step` takes the next knot's value as soon as the earlier one is passed.
        knots: (share of the steps, factor) pairs, ascending in the share; the first and last value hold outside.

    >>> [Schedule("linear", [[0.2, 1.0], [0.6, 0.5]])(share) for share in (0.0, 0.4, 1.0)]
    [1.0, 0.75, 0.5]
    """

    form: Literal["constant", "linear", "quintic", "step"] = "constant"
    knots: Sequence[Sequence[float]] = ((0.0, 1.0),)

    def __post_init__(self) -> None:
        """Check form and knots.

        Raises:
            InputError: An unknown form, or knots that are not pairs, do not ascend, or hold a negative factor.
        """
        if self.form not in FORMS:
            raise InputError(f"schedule.form={self.form}: accepted are {', '.join(FORMS)}")
        listed = [list(knot) for knot in self.knots]
        if not listed or any(len(knot) != 2 or knot[1] < 0 for knot in listed):
            raise InputError(f"schedule.knots={listed}: give one or more [share of the steps, factor >= 0]")
        if any(a[0] >= b[0] for a, b in pairwise(listed)):
            raise InputError(f"schedule.knots={listed}: shares must ascend")

    def __call__(self, share: float) -> float:
        """Factor after this share of the steps (0..1)."""
        if self.form == "constant":
            return 1.0
        if share <= self.knots[0][0]:
            return float(self.knots[0][1])
        for (start, before), (end, after) in pairwise(self.knots):
            if share < end:
                progress = self._progress((share - start) / (end - start))
                return float((1 - progress) * before + progress * after)
        return float(self.knots[-1][1])

    def _progress(self, s: float) -> float:
        if self.form == "step":
            return float(s > 0)
        return 1 - (1 - s) ** 5 if self.form == "quintic" else s
