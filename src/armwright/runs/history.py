"""The history of a study: its finished trials, their front and hypervolume."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.exceptions import SettingsError
from armwright.pareto import (
    default_reference_point,
    feasible_mask,
    front_indices,
    front_mask,
    hypervolume_history,
    masked_objectives,
    total_violation,
)
from armwright.problem.evaluation import Evaluation
from armwright.problem.problem import Problem
from armwright.problem.stated_bounds import stated_bounds, with_bounds
from armwright.robot.arm import Arm
from armwright.runs.config import Method
from armwright.runs.trial import FinishedTrial
from armwright.spaces.parameters import Design

RANDOM = "random"
BBO = "bbo"
INITIAL_DESIGN = "initial_design"  # of the user, such as an existing arm
FRONT_SEARCH = "front_search"
NOT_PROPOSED = (RANDOM, BBO, INITIAL_DESIGN, FRONT_SEARCH)
_LABELS = {  # of sources, where they differ from the name
    BBO: "black box",
    INITIAL_DESIGN: "initial design",
    FRONT_SEARCH: "front search",
    "llm": "language model",
    "scripted": "scripted stand-in",
}
FEW = 5  # successful trials that a reference point is chosen from


def source_label(source: str) -> str:
    """Return how tables and figures call a source of trials."""
    return _LABELS.get(source, source)


@dataclass(frozen=True)
class FrontMember:
    """A design of the Pareto set and the arm that it builds."""

    number: int
    source: str
    design: Design
    arm: Arm
    values: tuple[float, ...]


@dataclass(frozen=True)
class History:
    """The finished trials of a study by number; the first `n_init` are random."""

    problem: Problem
    trials: Sequence[FinishedTrial]
    n_init: int  # number of random trials
    frozen_reference_point: tuple[float, ...] | None = None  # from the random trials, if the task states none
    method: Method | None = None  # the search settings of the study; None outside one

    def __len__(self) -> int:
        return len(self.trials)

    def __iter__(self) -> Iterator[FinishedTrial]:
        return iter(self.trials)

    def _matrix(self, name: str, width: int) -> Array:
        """Return the (N, width) matrix of a field of the trials."""
        rows = np.array([getattr(trial, name) for trial in self.trials], dtype=np.float64)
        return rows.reshape(len(self), width)

    @cached_property
    def values(self) -> Array:
        """(N, M) objectives, infinite where not evaluated or that failed; units as in the problem's objectives."""
        return self._matrix("values", len(self.problem.objectives))

    @cached_property
    def violations(self) -> Array:
        """(N, C) violation of each constraint of the task; satisfied at <= 0."""
        return self._matrix("violations", len(self.problem.constraints))

    @cached_property
    def failed(self) -> NDArray[np.bool_]:
        """(N,) True if the evaluation failed."""
        return np.array([trial.failure is not None for trial in self.trials], dtype=bool)

    @cached_property
    def evaluated(self) -> NDArray[np.bool_]:
        """(N,) True if all objectives are known."""
        return np.array([trial.is_evaluated for trial in self.trials], dtype=bool)

    @cached_property
    def feasible(self) -> NDArray[np.bool_]:
        """(N,) True if the evaluation succeeded and all constraints are satisfied."""
        return feasible_mask(self.violations) & ~self.failed

    @cached_property
    def masked_objectives(self) -> Array:
        """(N, M) `values`, infinite for infeasible designs, as fronts and hypervolumes need them."""
        if not self.problem.constraints:
            return self.values
        return masked_objectives(self.values, self.violations)

    def nearest(self, n: int) -> list[int]:
        """Return at most `n` trial numbers, by increasing total violation; failed evaluations last."""
        return np.lexsort((total_violation(self.violations), self.failed))[:n].tolist()

    @property
    def reference_point(self) -> tuple[float, ...] | None:
        """The task's, else the frozen one; None before the first n_init trials."""
        return self.problem.reference_point or self.frozen_reference_point

    @cached_property
    def front(self) -> list[FrontMember]:
        """The Pareto set of the feasible designs, by increasing first objective."""
        return [self.member(number) for number in front_indices(self.masked_objectives)] if len(self) else []

    @cached_property
    def proposed(self) -> tuple[FinishedTrial, ...]:
        """The trials of proposers."""
        return tuple(trial for trial in self.trials if trial.source not in NOT_PROPOSED)

    def before(self, number: int) -> "History":
        """Return the history at the start of trial `number`."""
        if number >= len(self):
            return self
        return History(self.problem, self.trials[:number], self.n_init, self.frozen_reference_point, self.method)

    def member(self, number: int) -> FrontMember:
        """Return the design of one trial and its arm."""
        if not 0 <= number < len(self):
            raise SettingsError(f"--design {number}: the run has the designs 0 to {len(self) - 1}")
        trial = self.trials[number]
        return FrontMember(number, trial.source, trial.design, self.problem.arm(trial.design), trial.values)

    @cached_property
    def hypervolumes(self) -> Array:
        """(N,) after each trial, the random ones included; (0,) without a reference point."""
        if self.reference_point is None:
            return np.zeros(0)
        return hypervolume_history(self.masked_objectives, self.reference_point)

    @property
    def hypervolume(self) -> Array:
        """After each counted trial (those after the first n_init); the random trials contribute to each value."""
        return self.hypervolumes[self.n_init :]

    def found_reference_point(self) -> tuple[float, ...] | None:
        """Choose a reference point: from the bounds that the constraints imply, else from the first n_init trials.

        If fewer than FEW of these succeeded, the trials up to the FEW-th success, or all so far; None without any.
        """
        succeeded = np.flatnonzero(self.evaluated)[: self._n_needed]
        if not len(succeeded):
            return None
        first = slice(max(self.n_init, int(succeeded[-1]) + 1))
        found = found_reference_point(self.values[first], self.violations[first])
        return with_bounds(found, stated_bounds(self.problem))

    @property
    def has_reference_trials(self) -> bool:
        """Whether enough trials have succeeded for a reference point that further ones do not change."""
        return len(self) >= self.n_init and int(self.evaluated.sum()) >= self._n_needed

    @property
    def _n_needed(self) -> int:
        return max(1, min(FEW, self.n_init))

    def angles(self, numbers: Sequence[int]) -> Array:
        """Return (n, T, J) joint angles [rad] or strokes [m] of designs at the targets; 0 for joints that they lack."""
        rows = [self.trials[number].q for number in numbers]
        if not all(rows):
            return self.evaluation(numbers).q
        width = max(len(angles[0]) for angles in rows)
        return np.array([[(*q, *[0.0] * (width - len(q))) for q in angles] for angles in rows])

    def evaluation(self, numbers: Sequence[int]) -> Evaluation:
        """Evaluate the designs of these trials again in the first case; the result is equal to the bit."""
        return self.problem.physics(self.matrix(numbers), entry=self.entry(numbers))

    def matrix(self, numbers: Sequence[int]) -> Array:
        """Return the (n, P) matrix of the designs of these trials."""
        return self.problem.space.matrix([self.trials[number].design for number in numbers])

    def entry(self, numbers: Sequence[int]) -> Array | None:
        """Return (n, C, B, D) postures of designs as in `Outcomes`; None if those of a design are not known."""
        rows = [self.trials[number].entry for number in numbers]
        return np.array(rows, dtype=np.float32).astype(np.float64) if all(rows) else None  # digits of float32


def found_reference_point(values: Array, violations: Array) -> tuple[float, ...]:
    """Choose a reference point from the feasible designs if their front has M designs, else from all.

    A front of fewer designs leaves hardly any volume within 1.1 times its values. If no design has all objectives, each
    is taken by itself, and one that none has is 1.
    """
    if not np.isfinite(values).all(axis=1).any():
        known = np.where(np.isfinite(values), values, -np.inf).max(axis=0)
        return default_reference_point(np.where(known > -np.inf, known, 1.0)[None])
    feasible = masked_objectives(values, violations)
    return default_reference_point(feasible if front_mask(feasible).sum() >= values.shape[1] else values)
