"""Budget and progress of a direct search."""

import re
from dataclasses import dataclass

from armwright.exceptions import SettingsError

MAX_BUDGET = 10**12
_BUDGET = re.compile(r"(\d+(?:\.\d+)?(?:e\d+)?)(s|min|h)?")
_SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0}


@dataclass(frozen=True)
class SearchBudget:
    """What a search may spend in all its sessions together.

    Attributes:
        evaluations: number of evaluations; None for no limit.
        seconds: search time [s]; None for no limit.
    """

    evaluations: int | None = None
    seconds: float | None = None

    def __post_init__(self) -> None:
        for name, bound in (("evaluations", self.evaluations), ("seconds", self.seconds)):
            if bound is not None and not 0.0 < bound <= MAX_BUDGET:
                raise SettingsError(f"a budget of {bound} {name}: above 0 and at most {MAX_BUDGET:g}")

    @classmethod
    def parse(cls, text: str) -> "SearchBudget":
        """Return the budget of `5s`, `2min`, `1h`, or of a number of evaluations such as `100000` or `1e6`."""
        match = _BUDGET.fullmatch(text.strip().replace("_", ""))
        amount = float(match[1]) if match else 0.0
        if match is None or not 0.0 < amount <= MAX_BUDGET or (match[2] is None and amount != int(amount)):
            raise SettingsError(
                f'budget = "{text}" is neither a time above 0 (5s, 2min, 1h) nor a number of evaluations (100000, 1e6)'
            )
        return cls(evaluations=int(amount)) if match[2] is None else cls(seconds=amount * _SECONDS[match[2]])

    def is_spent(self, evaluations: int, seconds: float) -> bool:
        """Return whether one of the limits is reached."""
        bounds = ((evaluations, self.evaluations), (seconds, self.seconds))
        return any(bound is not None and spent >= bound for spent, bound in bounds)


@dataclass(frozen=True)
class SearchProgress:
    """Progress of a direct search.

    Attributes:
        evaluations: designs evaluated in all sessions.
        seconds: search time of all sessions [s].
        hypervolume: hypervolume of the front.
        front_size: designs on the front.
        budget: the budget of the search.
    """

    evaluations: int
    seconds: float
    hypervolume: float
    front_size: int
    budget: SearchBudget
