"""What the surrogate of a run learned of its objectives, for summary.json."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Effect:
    """The effect of an input on the predictions of an objective.

    Attributes:
        name: A quantity of the built-in physics, a parameter, or a count of joints.
        share: Half the mean squared change of predictions when the input is permuted among the designs, relative to the
            variance of the objective; both in the transformed scale.
    """

    name: str
    share: float


@dataclass(frozen=True)
class LearnedObjective:
    """How well an objective is predicted, and by what.

    Attributes:
        name: The objective.
        explained: Share of the variance of the transformed values that predictions explain, each design left out in
            turn; None if the objective is constant.
        relative_error: Median of |prediction - value| / |value| of designs left out; None if half of the values are 0.
        inputs: The set of inputs that predicts best: `physics`, `dynamics` or `parameters`.
        effects: The inputs with the largest effects; none if little is explained.
        correction: How the objective follows from a quantity of the built-in physics; empty if evidence is weak.
        predicted: Values of the designs of the summary, each predicted from the others.
        log_shift: What is added before the logarithm that is predicted; None if the values are predicted as they are.
    """

    name: str
    explained: float | None
    relative_error: float | None
    inputs: str
    effects: Sequence[Effect]
    correction: str
    predicted: Sequence[float]
    log_shift: float | None


@dataclass(frozen=True)
class SurrogateSummary:
    """What the surrogate of a run learned.

    Attributes:
        designs: Number of different designs whose evaluation did not fail.
        trials: Their numbers.
        objectives: What it learned of each objective.
    """

    designs: int
    trials: Sequence[int]
    objectives: Sequence[LearnedObjective]
