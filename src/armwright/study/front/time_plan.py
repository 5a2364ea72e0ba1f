"""Plan of the wall-clock time of a search: how much for evaluations, and how much for what follows them.

What follows is the simulation and perturbation of at most five recommended designs, the verification of at most 300
designs of the front, their files, figures and a page. Its cost is measured on designs of the run. If it would take more
than a share of the time, fewer designs of the front are kept.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

from armwright.kinematics.devices import compilation
from armwright.study.front.search_budget import SearchBudget
from armwright.tasks.task import Task

MAX_DESIGNS = 300  # of the front that become trials
SEARCH_SHARE = 0.3  # of the time that the search gets at least
RESULTS_SHARE = 0.3  # of the time at most for results; as much while their cost is unknown
LATE_SECONDS, LATE_SHARE = 1.0, 0.2  # [s] for verifying and writing designs even if the time is up, or this share of it
MEASURED_AT = 0.2  # spent share of the budget from which on costs are measured
DRAWING_SECONDS = 3.0  # [s]: page and figures
RECOMMENDED = 5  # designs
SIMULATIONS = 3  # per recommended design: as it is, and with assumed values halved and doubled
CHUNK_SHARE, CHUNK_SECONDS = 0.02, (0.5, 5.0)  # of the budget between two looks at the clock, and its bounds [s]
FILES_SECONDS, CYCLE_FILES_SECONDS = 0.004, 0.05  # [s] of a design's files and its part of the page; with a cycle
SMALLEST_CHUNK, CHUNK_GROWTH = 16, 4  # designs, of which fewer take nearly as long; largest factor to the next chunk


@dataclass(frozen=True)
class ResultCosts:
    """Measured cost of results."""

    design: float  # to verify a design and write its files [s]
    simulation: float | None = None  # to simulate a design [s]; None while none is feasible
    survival: float = 0.0  # to evaluate the survival of a design [s]


class TimePlan:
    """Share out the wall-clock time of a search, without the compilation of kernels.

    Args:
        budget: the budget.
        drawing: whether figures and a page follow the search.
        started: when the time began by the clock; None for now.
        clock: a clock [s].
        excluded: returns the time that does not count so far [s].
    """

    def __init__(
        self,
        budget: SearchBudget,
        drawing: bool = False,
        started: float | None = None,
        clock: Callable[[], float] = time.monotonic,
        excluded: Callable[[], float] = lambda: compilation.seconds,
    ) -> None:
        self.budget = budget
        self.earlier = 0.0  # time of earlier sessions that counts [s]
        self.costs: ResultCosts | None = None  # until measured
        self.n_found = MAX_DESIGNS  # designs on the front
        self._limit = math.inf if budget.seconds is None else budget.seconds
        self._drawing = DRAWING_SECONDS if drawing else 0.0
        self._clock, self._excluded = clock, excluded
        self._started = (clock() if started is None else started) - excluded()
        self._search_started = 0.0

    @property
    def elapsed(self) -> float:
        """Time of this session [s]."""
        return self._clock() - self._started - self._excluded()

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
        """Time until the budget is spent [s]; infinite without a limit."""
        return self._limit - self.spent

    @property
    def left_for_results(self) -> float:
        """Time until page and figures have to begin [s]."""
        return self.left - self._drawing

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
        reserved = RESULTS_SHARE * self.session
        if self.costs is not None:
            verified = min(MAX_DESIGNS, self.n_found) * self.costs.design
            reserved = min(reserved, self._seconds_for_recommended + verified)
        at_least = SEARCH_SHARE * self.session - self.search_seconds
        return max(self.left_for_results - reserved, min(at_least, self.left))

    def should_measure(self, is_feasible: bool) -> bool:
        """Return whether it is time to measure the cost of results; is_feasible: whether a design is feasible."""
        is_open = self.costs is None or (is_feasible and self.costs.simulation is None)
        return is_open and self.spent >= MEASURED_AT * self._limit

    @property
    def n_designs(self) -> int:
        """Number of designs of the front that there is time to verify and write."""
        if math.isinf(self._limit):
            return MAX_DESIGNS
        if self.costs is None:
            return 1
        left = self.left_for_results
        seconds = max(left / 2.0, left - self._seconds_for_recommended, min(LATE_SECONDS, LATE_SHARE * self._limit))
        return int(min(MAX_DESIGNS, max(1.0, seconds / max(self.costs.design, 1e-9))))

    def has_time_for(self, simulations: int, survivals: int, after: float) -> bool:
        """Return whether there is time to simulate some designs, and to evaluate the survival of some.

        Args:
            simulations: number of simulations.
            survivals: number of designs whose survival is evaluated.
            after: time that writing the files takes afterwards [s]; page and figures follow.
        """
        return self.left_for_results - after >= self._seconds_for(simulations, survivals)

    @property
    def _seconds_for_recommended(self) -> float:
        recommended = min(RECOMMENDED, self.n_found)
        return self._seconds_for(SIMULATIONS * recommended, recommended)

    def _seconds_for(self, simulations: int, survivals: int) -> float:
        """Return the time of simulations and evaluations of survival, as far as it is known [s]."""
        costs = self.costs or ResultCosts(0.0)
        return simulations * (costs.simulation or 0.0) + survivals * costs.survival


def files_seconds(task: Task) -> float:
    """Return about how long it takes to write the files of a design [s]."""
    return FILES_SECONDS if task.cycle is None else CYCLE_FILES_SECONDS


class ChunkSize:
    """Number of designs to evaluate between two looks at the clock, found from one chunk to the next.

    Args:
        budget: the budget of the search.

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
