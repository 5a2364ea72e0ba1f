"""A finished trial: one evaluated design, and one line of trials.jsonl.

`FinishedTrial` is the only place that lists the fields. Reading and writing lines is derived from it.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, ClassVar

from pydantic import ConfigDict, Field, PlainSerializer, PlainValidator, TypeAdapter, WrapValidator

from armwright.arrays import LARGEST_OBJECTIVE
from armwright.files import replace_surrogates
from armwright.pareto import NOT_EVALUATED, PENALTY
from armwright.problem.failure import Failure
from armwright.problem.objective import Objective
from armwright.problem.outcomes import Outcome
from armwright.runs.config import RunConfig
from armwright.spaces.parameters import Design, ParameterValue

LONGEST = 1e8  # [s]

Count = Annotated[int, Field(ge=0, lt=2**63)]


def _null_for(missing: float) -> tuple[Any, Any]:
    """Return how a number is read and written whose value, of what was not evaluated, is null in a line."""
    return (
        WrapValidator(lambda given, check: missing if given is None else check(given)),
        PlainSerializer(lambda value: None if value >= missing else value),
    )


_Objective = Annotated[float, Field(ge=-LARGEST_OBJECTIVE, le=LARGEST_OBJECTIVE), *_null_for(math.inf)]
_Objectives = tuple[_Objective, ...]
_Violations = tuple[Annotated[float, Field(ge=-PENALTY, le=PENALTY), *_null_for(NOT_EVALUATED)], ...]
_Angles = tuple[tuple[Annotated[float, Field(ge=-LONGEST, le=LONGEST)], ...], ...]
_Entry = tuple[_Angles, ...]
_Seconds = Mapping[str, Annotated[float, Field(ge=-LONGEST, le=LONGEST)]]

_PARAMS: TypeAdapter[dict[str, ParameterValue]] = TypeAdapter(dict[str, float | str], config=ConfigDict(strict=True))

_Params = Annotated[  # a design is written as its parameters
    Design,
    Field(alias="params"),
    PlainValidator(lambda params: Design(_PARAMS.validate_python(params))),
    PlainSerializer(lambda design: dict(design.params)),
]
_Text = Annotated[str, PlainSerializer(replace_surrogates)]


@dataclass(frozen=True)
class ScreenedOut:
    """A proposal that was not evaluated, because the surrogate expected too little of it."""

    source: str  # name of the proposer
    proposal: str  # its id
    gain: float  # expected gain of hypervolume, as a share of the best candidate's
    predicted: tuple[float, ...]  # objectives that the surrogate predicted

    def describe(self, objectives: Sequence[Objective]) -> str:
        """Return in one line what was predicted of the proposal."""
        pairs = zip(objectives, self.predicted, strict=True)
        values = ", ".join(f"{o.name.replace('_', ' ')} {value:.4g} {o.unit}".rstrip() for o, value in pairs)
        gain = f"expected gain {100.0 * self.gain:.2g} % of the best candidate's"
        return f"{self.proposal} was not evaluated: predicted {values}; {gain}"


@dataclass(frozen=True)
class FinishedTrial:
    """Hold one evaluated design."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)

    number: int  # of the trial in its run, from 0
    source: str  # `random`, `initial_design`, `bbo`, `front_search`, or the name of the proposer
    design: _Params  # what was evaluated
    values: _Objectives  # objectives; infinite if not evaluated, null in its line, or if that failed, and left out
    proposal: str | None = None  # the proposal's id, if a proposer made the design
    reason: _Text = ""  # why the proposer suggested it
    fault: str | None = None  # why a trial that was a proposer's became a black-box one
    asked: int | None = None  # the trial that the proposal was asked for, if another one
    feedback: int | None = None  # how many finished trials the proposer knew, if not all before this one
    duplicate_of: int | None = None  # earlier trial of an equal design, whose values it has: not evaluated again
    seconds: _Seconds = field(default_factory=dict[str, float])  # wall time: total, proposing, sampling, evaluation
    # Attributes that the sampler set on its trial and study, needed to resume
    sampler_notes: Mapping[str, Mapping[str, Any]] = field(default_factory=dict[str, Mapping[str, Any]])
    q: _Angles = ()  # postures as in `Outcome`
    entry: _Entry = ()
    violations: _Violations = ()  # of each constraint; satisfied at <= 0
    failure: Failure | None = None  # why the custom evaluator gave no values, which makes the design infeasible
    screened: ScreenedOut | None = None  # proposal replaced by this design, as the surrogate expected little of it

    @property
    def outcome(self) -> Outcome:
        """What its evaluation found."""
        return Outcome(self.values, self.violations, self.failure, self.q, self.entry)

    @property
    def is_evaluated(self) -> bool:
        """Return whether all of its objectives are known."""
        return all(map(math.isfinite, self.values))

    @property
    def answer(self) -> str | None:
        """The id of the proposal that the trial used up, evaluated or not."""
        return self.proposal if self.screened is None else self.screened.proposal

    @property
    def request(self) -> tuple[int, int] | None:
        """The trial that a proposal was requested for and the number of finished trials known then, if one was."""
        if self.answer is None and self.fault is None:
            return None
        asked, feedback = (self.number if value is None else value for value in (self.asked, self.feedback))
        return asked, feedback

    @property
    def is_feasible(self) -> bool:
        """Return whether its evaluation succeeded and it satisfies all constraints."""
        return self.failure is None and all(violation <= 0.0 for violation in self.violations)


_LINE: TypeAdapter[FinishedTrial] = TypeAdapter(FinishedTrial)


def trial_line(trial: FinishedTrial) -> bytes:
    """Return the line of a trial: fields that have their default are left out, but for `proposal`."""
    if trial.failure is not None:
        trial = replace(trial, values=())  # JSON has no infinity
    fields = _LINE.dump_python(trial, mode="json", by_alias=True, exclude_defaults=True)
    return (
        json.dumps({"number": trial.number, "source": trial.source, "proposal": trial.proposal} | fields).encode()
        + b"\n"
    )


def parse_trial(line: bytes, number: int, config: RunConfig) -> FinishedTrial:
    """Return the trial of a line.

    Raises:
        ValueError: The line is not a trial, or not trial `number` of such a run.
        DesignError: Its design is not in the space.
    """
    if not line.strip():
        raise ValueError("blank")
    trial = _LINE.validate_json(line)
    for name, found, expected in (
        ("values", trial.values, () if trial.failure is not None else config.objectives),
        ("violations", trial.violations, config.problem.constraints),
    ):
        if len(found) != len(expected):
            raise ValueError(f"expected {len(expected)} {name}, found {len(found)}")
    if trial.q and (len(trial.q) != len(config.task.target_positions) or len(set(map(len, trial.q))) > 1):
        raise ValueError(f"q: expected as many angles for each of {len(config.task.target_positions)} targets")
    if trial.entry:
        scenes = config.problem.scenes
        blocks = 0 if scenes[0].plan is None else len(scenes[0].plan.blocks)
        lengths = {len(q) for case in trial.entry for q in case}
        if [*map(len, trial.entry)] != [blocks] * len(scenes) or lengths != {len(q) for q in trial.q}:
            raise ValueError(
                f"entry: expected as many angles for each of {blocks} blocks in each of {len(scenes)} cases"
            )
    if trial.number != number:
        raise ValueError(f"expected trial number {number}, found {trial.number}")
    if trial.failure is not None:
        trial = replace(trial, values=(math.inf,) * len(config.objectives))
    return replace(trial, design=config.space.design(trial.design.params))
