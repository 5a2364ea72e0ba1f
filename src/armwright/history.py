"""What a study has found so far: its finished trials, their front and hypervolume."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from armwright.arm import Arm
from armwright.evaluation import Array, Evaluation
from armwright.pareto import default_reference_point, front_numbers, hypervolume_history
from armwright.problem import Problem
from armwright.space import Design

RANDOM = "random"
BBO = "bbo"


@dataclass(frozen=True)
class FinishedTrial:
    """One evaluated design.

    source: `random`, `bbo`, or the name of the proposer.
    proposal, reason: the proposal's id and reason, where a proposer made the design.
    fault: why a trial that was a proposer's became a black-box one.
    seconds: wall time by part (proposing, sampling, evaluation).
    """

    number: int
    source: str
    design: Design
    values: tuple[float, ...]
    proposal: str | None = None
    reason: str = ""
    fault: str | None = None
    seconds: Mapping[str, float] = field(default_factory=dict[str, float])


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
    """The finished trials of a study in the order of their numbers; the first `n_init` are random."""

    problem: Problem
    trials: Sequence[FinishedTrial]
    n_init: int

    def __len__(self) -> int:
        return len(self.trials)

    def __iter__(self) -> Iterator[FinishedTrial]:
        return iter(self.trials)

    @cached_property
    def values(self) -> Array:
        """(N, 2) position error [m] and torque [α-scaled]."""
        return np.array([trial.values for trial in self.trials]).reshape(len(self.trials), len(self.problem.objectives))

    @cached_property
    def reference_point(self) -> tuple[float, float] | None:
        """The problem's own, else 1.1 times the worst non-dominated values of the first n_init trials."""
        if self.problem.reference_point is not None:
            return self.problem.reference_point
        return default_reference_point(self.values[: self.n_init]) if len(self.trials) >= self.n_init else None

    @cached_property
    def front(self) -> list[FrontMember]:
        """The Pareto set, by rising position error."""
        return [self.member(number) for number in front_numbers(self.values)]

    def member(self, number: int) -> FrontMember:
        """The design of one trial and its arm."""
        trial = self.trials[number]
        return FrontMember(number, trial.source, trial.design, self.problem.arm(trial.design), trial.values)

    @cached_property
    def hypervolume(self) -> Array:
        """Over the counted trials (those after the first n_init); the initial points count in each value."""
        if self.reference_point is None:
            return np.zeros(0)
        return hypervolume_history(self.values, self.reference_point)[self.n_init :]

    def evaluation(self, numbers: Sequence[int]) -> Evaluation:
        """The physics of these trials' designs, computed again (the kernels give the same bits)."""
        return self.problem.evaluation([self.trials[number].design for number in numbers])
