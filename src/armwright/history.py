"""What a study has found so far: its finished trials, their front and hypervolume."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armwright.arm import Arm
from armwright.evaluation import Array, Evaluation
from armwright.feasibility import counted, feasible_mask, violation
from armwright.parameters import Design
from armwright.pareto import default_reference_point, front_mask, front_numbers, hypervolume_history
from armwright.problem import Problem

RANDOM = "random"
BBO = "bbo"
START = "start"  # an arm that is there already
POLISH = "polish"  # a design of the front, refined
FRONT = "front"  # of a search for the whole front


@dataclass(frozen=True)
class FinishedTrial:
    """One evaluated design.

    constraints: how far it breaks each constraint of the task, <= 0: not at all.
    source: `random`, `start`, `bbo`, `polish`, `front`, or the name of the proposer.
    proposal, reason, expected: the proposal's id and reason, and the objectives that were expected of it, where a
        proposer made the design (and said so).
    fault: why a trial that was a proposer's became a black-box one.
    asked: the trial that a proposal was asked for, where it came for another (overlap, several proposals a call).
    feedback: how many finished trials the proposer knew, where not all before this one.
    refines: the trial whose design was refined for this one.
    evaluations: designs that were evaluated to find it (a refined one: many; the same arm as an earlier one: none).
    same_as: the earlier trial whose arm it is, and whose values it has (`canonical.py`).
    failure: why an evaluator of one's own gave no values, so that the design has the worst.
    seconds: wall time by part (proposing, sampling, evaluation).
    sampler_notes: what the sampler noted on its trial and study (a genetic one: generations), needed to resume.
    """

    number: int
    source: str
    design: Design
    values: tuple[float, ...]
    proposal: str | None = None
    reason: str = ""
    expected: tuple[float, ...] | None = None
    fault: str | None = None
    asked: int | None = None
    feedback: int | None = None
    refines: int | None = None
    evaluations: int = 1
    same_as: int | None = None
    seconds: Mapping[str, float] = field(default_factory=dict[str, float])
    sampler_notes: Mapping[str, Mapping[str, Any]] = field(default_factory=dict[str, Mapping[str, Any]])
    constraints: tuple[float, ...] = ()
    failure: str = ""

    @property
    def is_feasible(self) -> bool:
        """Whether it meets all constraints."""
        return all(broken <= 0.0 for broken in self.constraints)


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
    """

    problem: Problem
    trials: Sequence[FinishedTrial]
    n_init: int
    frozen_reference_point: tuple[float, ...] | None = None

    def __len__(self) -> int:
        return len(self.trials)

    def __iter__(self) -> Iterator[FinishedTrial]:
        return iter(self.trials)

    @cached_property
    def values(self) -> Array:
        """(N, M) the objectives; of the paper's: position error [m], torque [α-scaled]."""
        return np.array([trial.values for trial in self.trials]).reshape(len(self.trials), len(self.problem.objectives))

    @cached_property
    def broken(self) -> Array:
        """(N, C) how far each constraint of the task is broken; <= 0: not at all."""
        rows = [trial.constraints for trial in self.trials]
        return np.array(rows, dtype=np.float64).reshape(len(rows), len(self.problem.constraints))

    @cached_property
    def feasible(self) -> NDArray[np.bool_]:
        """(N,) whether all constraints are met; of a task without any: always."""
        return feasible_mask(self.broken)

    @cached_property
    def counted(self) -> Array:
        """(N, M) `values`, infinite where a design is infeasible: what fronts and hypervolumes are made of."""
        return counted(self.values, self.broken)

    def nearest(self, most: int) -> list[int]:
        """The numbers of so many designs at most that break the constraints least, summed; the nearest first."""
        return np.argsort(violation(self.broken), kind="stable")[:most].tolist()

    @property
    def reference_point(self) -> tuple[float, ...] | None:
        """The task's own, else the frozen one; None before the first n_init trials."""
        return self.problem.reference_point or self.frozen_reference_point

    @cached_property
    def front(self) -> list[FrontMember]:
        """The Pareto set of the feasible designs, by rising first objective."""
        return [self.member(number) for number in front_numbers(self.counted)]

    def before(self, number: int) -> "History":
        """What was known when trial `number` began."""
        return History(self.problem, self.trials[:number], self.n_init, self.frozen_reference_point)

    def member(self, number: int) -> FrontMember:
        """The design of one trial and its arm."""
        trial = self.trials[number]
        return FrontMember(number, trial.source, trial.design, self.problem.arm(trial.design), trial.values)

    @cached_property
    def hypervolume(self) -> Array:
        """Over the counted trials (those after the first n_init); the initial points count in each value."""
        if self.reference_point is None:
            return np.zeros(0)
        return hypervolume_history(self.counted, self.reference_point)[self.n_init :]

    def found_reference_point(self) -> tuple[float, ...]:
        """For a task that states none, from the first n_init trials."""
        return found_reference_point(self.values[: self.n_init], self.broken[: self.n_init])

    def evaluation(self, numbers: Sequence[int]) -> Evaluation:
        """The physics of these trials' designs, computed again (the kernels give the same bits)."""
        return self.problem.evaluation([self.trials[number].design for number in numbers])


def found_reference_point(values: Array, broken: Array) -> tuple[float, ...]:
    """From the feasible designs of values (N, M) and broken (N, C), where their front has M designs; else from all.

    A front of fewer is the worst of itself in some objective: within 1.1 times its values there is hardly any room.
    """
    feasible = counted(values, broken)
    return default_reference_point(feasible if front_mask(feasible).sum() >= values.shape[1] else values)
