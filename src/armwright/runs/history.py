"""The history of a study: its finished trials, their front and hypervolume."""

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.pareto import (
    FrontTracker,
    default_reference_point,
    feasible_mask,
    front_indices,
    front_mask,
    masked_objectives,
    total_violation,
)
from armwright.problem.evaluation import Evaluation
from armwright.problem.problem import Problem
from armwright.robot.arm import Arm
from armwright.runs.trial import FinishedTrial
from armwright.spaces.parameters import Design

RANDOM = "random"
BBO = "bbo"
INITIAL_DESIGN = "initial_design"  # given by the user, such as an existing arm
REFINE = "refine"  # a refined design of the front
FRONT_SEARCH = "front_search"
NOT_PROPOSED = (RANDOM, BBO, INITIAL_DESIGN, REFINE, FRONT_SEARCH)
GROWING = (
    "values",
    "violations",
    "masked_objectives",
    "front",
    "proposed",
    "_course",
    "_first_of",
)  # what more trials add to


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
    """The finished trials of a study in the order of their numbers; the first `n_init` are random.

    frozen_reference_point: the one that the run found for itself, where the task states none.
    earlier: what is known of a history that this one goes on with, and of how many trials (`grown`).
    """

    problem: Problem
    trials: Sequence[FinishedTrial]
    n_init: int
    frozen_reference_point: tuple[float, ...] | None = None
    earlier: Mapping[str, tuple[int, Any]] = field(
        default_factory=dict[str, tuple[int, Any]], repr=False, compare=False
    )

    def __len__(self) -> int:
        return len(self.trials)

    def __iter__(self) -> Iterator[FinishedTrial]:
        return iter(self.trials)

    def grown(self, trials: Sequence[FinishedTrial], frozen_reference_point: tuple[float, ...] | None) -> "History":
        """Return the history of these trials, which begin with this one's; reuse the values computed for those."""
        same_point = frozen_reference_point == self.frozen_reference_point
        if same_point and len(trials) == len(self):
            return self
        known = {**self.earlier, **{name: (len(self), vars(self)[name]) for name in GROWING if name in vars(self)}}
        if not same_point:
            known.pop("_course", None)
        return History(self.problem, trials, self.n_init, frozen_reference_point, known)

    def _known(self, name: str, nothing: Any) -> tuple[Any, Sequence[FinishedTrial]]:
        """Return the earlier history's value, and the trials after it."""
        n, known = self.earlier.get(name, (0, nothing))
        return known, self.trials[n:]

    @cached_property
    def values(self) -> Array:
        """(N, M) the objectives; of the paper's: position error [m], torque [α-scaled]."""
        known, new = self._known("values", np.empty((0, len(self.problem.objectives))))
        rows = [trial.values for trial in new]
        return np.vstack([known, np.array(rows, dtype=np.float64).reshape(len(rows), known.shape[1])])

    @cached_property
    def violations(self) -> Array:
        """(N, C) violation of each constraint of the task; satisfied at <= 0."""
        known, new = self._known("violations", np.empty((0, len(self.problem.constraints))))
        rows = [trial.violations for trial in new]
        return np.vstack([known, np.array(rows, dtype=np.float64).reshape(len(rows), known.shape[1])])

    @cached_property
    def feasible(self) -> NDArray[np.bool_]:
        """(N,) whether all constraints are met; of a task without any: always."""
        return feasible_mask(self.violations)

    @cached_property
    def masked_objectives(self) -> Array:
        """(N, M) `values`, infinite where a design is infeasible: what fronts and hypervolumes are made of."""
        if not self.problem.constraints:
            return self.values
        known, _ = self._known("masked_objectives", np.empty((0, len(self.problem.objectives))))
        n = len(known)
        return np.vstack([known, masked_objectives(self.values[n:], self.violations[n:])])

    def nearest(self, most: int) -> list[int]:
        """Return at most this many trial numbers with the smallest total violation, in its order."""
        return np.argsort(total_violation(self.violations), kind="stable")[:most].tolist()

    @property
    def reference_point(self) -> tuple[float, ...] | None:
        """The task's own, else the frozen one; None before the first n_init trials."""
        return self.problem.reference_point or self.frozen_reference_point

    @cached_property
    def front(self) -> list[FrontMember]:
        """The Pareto set of the feasible designs, by rising first objective."""
        known, new = self._known("front", [])
        members = {member.number: member for member in known}
        numbers = [*sorted(members), *range(len(self) - len(new), len(self))]
        on_front = [numbers[place] for place in front_indices(self.masked_objectives[numbers])] if numbers else []
        return [members[number] if number in members else self.member(number) for number in on_front]

    @cached_property
    def proposed(self) -> tuple[FinishedTrial, ...]:
        """The trials that are proposers'."""
        known, new = self._known("proposed", ())
        return (*known, *(trial for trial in new if trial.source not in NOT_PROPOSED))

    @cached_property
    def _first_of(self) -> dict[Design, int]:
        """The first trial of each design; histories that grow from one another add to the same one."""
        known, new = self._known("_first_of", {})
        for trial in new:
            known.setdefault(trial.design, trial.number)
        return known

    def has_tried(self, design: Design) -> bool:
        """Return whether a trial has this design."""
        return self._first_of.get(design, len(self)) < len(self)

    def before(self, number: int) -> "History":
        """Return the history at the start of trial `number`."""
        if number >= len(self):
            return self
        return History(self.problem, self.trials[:number], self.n_init, self.frozen_reference_point)

    def member(self, number: int) -> FrontMember:
        """Return the design of one trial and its arm."""
        trial = self.trials[number]
        return FrontMember(number, trial.source, trial.design, self.problem.arm(trial.design), trial.values)

    @cached_property
    def _course(self) -> tuple[Array, FrontTracker]:
        """(N,) `hypervolumes`, and what they go on with."""
        assert self.reference_point is not None
        tracker = FrontTracker(len(self.problem.objectives), self.reference_point)
        (known, tracker), _ = self._known("_course", (np.zeros(0), tracker))
        tracker, new = copy(tracker), np.zeros(len(self) - len(known))
        for i, row in enumerate(self.masked_objectives[len(known) :]):
            tracker.add(row)
            new[i] = tracker.hypervolume
        return np.concatenate([known, new]), tracker

    @property
    def hypervolumes(self) -> Array:
        """(N,) after each trial, the random ones included; (0,) as long as there is no reference point."""
        return np.zeros(0) if self.reference_point is None else self._course[0]

    @property
    def hypervolume(self) -> Array:
        """Over the counted trials (those after the first n_init); the initial points count in each value."""
        return self.hypervolumes[self.n_init :]

    def found_reference_point(self) -> tuple[float, ...]:
        """Choose a reference point from the first n_init trials."""
        return found_reference_point(self.values[: self.n_init], self.violations[: self.n_init])

    def evaluation(self, numbers: Sequence[int]) -> Evaluation:
        """Evaluate the designs of these trials again; the kernels return the same bits."""
        return self.problem.physics([self.trials[number].design for number in numbers])


def found_reference_point(values: Array, broken: Array) -> tuple[float, ...]:
    """Choose a reference point from the feasible designs if their front has M designs, else from all.

    A front of fewer is the worst of itself in some objective: within 1.1 times its values there is hardly any room.
    """
    feasible = masked_objectives(values, broken)
    return default_reference_point(feasible if front_mask(feasible).sum() >= values.shape[1] else values)
