"""Budget and progress of a direct search."""

import math
import re
from dataclasses import dataclass

from armwright.exceptions import SettingsError

MAX_BUDGET = 10**12
DEFAULT_BUDGET = "30s"
_TIME = re.compile(r"(\d+(?:\.\d+)?(?:e\d+)?)(s|min|h)?")
_SECONDS = {None: 1.0, "s": 1.0, "min": 60.0, "h": 3600.0}


@dataclass(frozen=True)
class SearchBudget:
    """What a search may spend in all its sessions together; whichever limit is reached first ends it."""

    evaluations: int | None = None  # number of evaluations, which the last batch may exceed; None for no limit
    seconds: float | None = None  # wall-clock time, with verification, files and figures [s]; None for no limit

    def __post_init__(self) -> None:
        for name, bound in (("evaluations", self.evaluations), ("seconds", self.seconds)):
            if bound is not None and not 0.0 < bound <= MAX_BUDGET:
                raise SettingsError(f"a budget of {bound} {name}: expected above 0 and at most {MAX_BUDGET:g}")

    @classmethod
    def of(cls, budget: str | float | None = None, evaluations: int | None = None) -> "SearchBudget":
        """Return the budget of a time such as `60s`, `5min`, `1h` or a number of seconds, and of evaluations.

        Without either, the time is 30 s. With evaluations alone, it is not limited.
        """
        if budget is None and evaluations is not None:
            return cls(evaluations=evaluations)
        return cls(evaluations, read_seconds(DEFAULT_BUDGET if budget is None else budget))


def read_seconds(budget: str | float) -> float:
    """Return the seconds of `60s`, `5min`, `1h`, or of a number of seconds."""
    match = _TIME.fullmatch(str(budget).strip().replace("_", ""))
    seconds = float(match[1]) * _SECONDS[match[2]] if match else 0.0
    if not 0.0 < seconds <= MAX_BUDGET:
        raise SettingsError(
            f'budget = "{budget}" is no time above 0, such as 60s, 5min, 1h, or 60 for seconds; use evaluations '
            "(--evaluations) for a number of designs"
        )
    return seconds


@dataclass(frozen=True)
class SearchProgress:
    """Progress of a direct search."""

    evaluations: int  # designs evaluated in all sessions
    seconds: float  # search time of all sessions [s]
    hypervolume: float | None  # hypervolume of the front; None while its reference point is provisional
    front_size: int  # designs on the front
    budget: SearchBudget
    seconds_left: float = math.inf  # search time that the budget leaves [s]; infinite without a limit
    is_ended: bool = False  # whether the search has ended, and its front is verified now

    @property
    def share(self) -> float:
        """Share of the budget that is spent, 0 to 1."""
        of_evaluations = self.evaluations / (self.budget.evaluations or math.inf)
        planned = self.seconds + self.seconds_left
        return min(1.0, max(of_evaluations, self.seconds / planned if planned > 0.0 else 1.0))
