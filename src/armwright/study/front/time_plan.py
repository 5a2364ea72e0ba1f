"""Plan of the wall-clock time of a search: most of it for evaluations, the rest for what follows them.

What follows is the verification of at most 300 designs of the front, the simulation and perturbation of at most five
recommended ones, their files, figures and a page. If it would take longer than its share, fewer designs are kept.
"""

import math
import time

from armwright.kinematics.devices import compilation
from armwright.study.front.search_budget import SearchBudget
from armwright.tasks.task import Task

MAX_DESIGNS = 300  # of the front that become trials
RESULTS_SHARE, RESULTS_SECONDS = 0.25, 60.0  # of the time, and [s]: for results, whichever is less
SEARCH_SHARE = 0.3  # of the time that the search gets at least, even if page and figures take most of it
LATE_SECONDS, LATE_SHARE = 1.0, 0.2  # [s] for verifying and writing designs even if the time is up, or this share of it
DRAWING_SECONDS = 3.0  # [s]: page and figures
FILES_SECONDS, CYCLE_FILES_SECONDS = 0.004, 0.05  # [s] of a design's files and its part of the page; with a cycle
CHUNK_SHARE, CHUNK_SECONDS = 0.02, (0.5, 5.0)  # of the budget between two looks at the clock, and its bounds [s]
SMALLEST_CHUNK, CHUNK_GROWTH = 16, 4  # designs, of which fewer take nearly as long; largest factor to the next chunk


class TimePlan:
    """Share out the wall-clock time of a search, without the compilation of kernels.

    With `drawing`, figures and a page follow the search. The time begins at `started` by the monotonic clock,
    or now.
    """

    def __init__(self, budget: SearchBudget, drawing: bool = False, started: float | None = None) -> None:
        self.budget = budget
        self.earlier = 0.0  # time of earlier sessions that counts [s]
        self._limit = math.inf if budget.seconds is None else budget.seconds
        self._drawing = DRAWING_SECONDS if drawing else 0.0
        self._started = (time.monotonic() if started is None else started) - compilation.seconds
        self._search_started = 0.0

    @property
    def elapsed(self) -> float:
        """Time of this session [s]."""
        return time.monotonic() - self._started - compilation.seconds

    @property
    def session(self) -> float:
        """Time that earlier sessions left to this one [s]; infinite without a limit."""
        return self._limit - self.earlier

    @property
    def spent(self) -> float:
        """Time of all sessions [s]."""
        return self.earlier + self.elapsed

    @property
    def left(self) -> float:
        """Time until page and figures have to begin [s]; infinite without a limit."""
        return self._limit - self.spent - self._drawing

    def begin_search(self) -> None:
        """Note that the search begins now."""
        self._search_started = self.elapsed

    @property
    def search_seconds(self) -> float:
        """Search time of this session [s]."""
        return self.elapsed - self._search_started

    @property
    def search_left(self) -> float:
        """Time until the search should end [s]; infinite without a limit."""
        if math.isinf(self._limit):
            return math.inf
        at_least = SEARCH_SHARE * self.session - self.search_seconds
        results = min(RESULTS_SHARE * self.session, RESULTS_SECONDS)
        return max(self.left - results, min(at_least, self.left + self._drawing))

    def n_designs(self, seconds: float) -> int:
        """Return how many designs there is time to verify and write, at `seconds` [s] each.

        Recommended designs get half of the time that is left.
        """
        left = max(self.left / 2.0, min(LATE_SECONDS, LATE_SHARE * self._limit))
        return int(min(MAX_DESIGNS, max(1.0, left / max(seconds, 1e-9))))


def files_seconds(task: Task) -> float:
    """Return about how long it takes to write the files of a design [s]."""
    return FILES_SECONDS if task.cycle is None else CYCLE_FILES_SECONDS


class ChunkSize:
    """Number of designs to evaluate between two looks at the clock, found from one chunk to the next.

    Attributes:
        value: the number of designs.
        seconds: the time that they should take [s].
    """

    def __init__(self, budget: SearchBudget) -> None:
        least, most = CHUNK_SECONDS
        self.value = SMALLEST_CHUNK
        self.seconds = min(most, max(least, CHUNK_SHARE * (budget.seconds or math.inf)))

    def adapt(self, designs: int, seconds: float) -> None:
        """Choose the next size from a chunk and its duration [s]."""
        affordable = designs * self.seconds / max(seconds, 1e-9)
        self.value = max(SMALLEST_CHUNK, int(min(affordable, CHUNK_GROWTH * self.value)))
