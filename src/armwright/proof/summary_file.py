"""Schema of summary.json: readers may rely on its fields, and ignore others."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal, cast

from pydantic import BaseModel, Field

from armwright.files import replace_surrogates
from armwright.proof.attribution import Attribution
from armwright.proof.front_gap import FrontGap
from armwright.proof.proposer_bias import ProposerBias
from armwright.proof.recommendation import Recommendation
from armwright.runs.trial import Count


class _Record(BaseModel, extra="allow", strict=True, allow_inf_nan=False):
    """A part of a summary; its settings also hold for the dataclasses in its fields."""


class _Volume(_Record):
    reference_point: list[float]
    final: float | None


class _Curve(_Volume):
    mean: float | None
    history: list[float]


class _Verdict(_Record):
    numbers: list[int]  # of the designs that hold; without constraints, of robust ones
    good: str
    bad: str


class _Verification(_Record):
    robust: Count
    sensitive: Count
    robust_numbers: list[int]
    verdict: _Verdict
    hypervolume_of_robust: float
    hypervolume_worst_case: float


class _Proposer(_Record):
    name: str
    model: str | None
    origin: str | None
    calls: Count
    failures: dict[str, Count]
    fallback_share: float
    flagged: bool
    tokens: Count
    input_tokens: Count
    output_tokens: Count
    cost_usd: float | None
    call_seconds: float
    differing_prompts: int = 0


class _Surrogate(_Record):
    designs: Count
    errors: dict[str, float | None]


class _Seconds(_Record):
    total: float
    sampling: float
    evaluation: float
    proposing: float


_Point = Annotated[list[float], Field(min_length=2, max_length=2)]


class _Search(_Record):
    evaluations: Count
    seconds: float
    ended_by: Literal["budget", "stall"]
    found: Count
    hypervolume_history: Annotated[list[_Point], Field(min_length=1)]
    infeasible: Count = 0
    reference_point_from: list[str]


class _Nearest(_Record):
    number: Count
    faults: str


class _Conflict(_Record):
    designs: Count
    satisfied_by: dict[str, Count]
    conflicts: list[list[str]]
    admitting: list[str]
    admitting_alone: str | None


class _Feasibility(_Record):
    nearest: _Nearest | None
    conflict: _Conflict | None


class _Summary(_Record):
    n_trials: Count
    by_source: dict[str, Count]
    front_gap: FrontGap | None
    front_size: Count
    verification: _Verification | None
    feasibility: _Feasibility | None = None
    assumed: dict[str, dict[str, float]] = {}
    recommended: list[Recommendation] = []


class StudySummary(_Summary):
    """Summary of a study."""

    hypervolume: _Curve
    duplicates: Count
    failures: dict[str, Count] = {}
    surrogate: _Surrogate | None = None
    screened_out: dict[str, Count] = {}
    attribution: dict[str, Attribution]
    proposer: _Proposer | None
    proposer_bias: ProposerBias | None
    seconds: _Seconds


class SearchSummary(_Summary):
    """Summary of a direct search."""

    hypervolume: _Volume
    search: _Search


def parse_summary(text: str) -> dict[str, Any]:
    """Validate and return the content of a summary.json; ValueError if it is damaged."""
    content = json.loads(text)
    schema = SearchSummary if isinstance(content, dict) and "search" in content else StudySummary
    schema.model_validate_json(replace_surrogates(json.dumps(content, ensure_ascii=False)))
    return cast("dict[str, Any]", content)


@dataclass(frozen=True)
class ProposerSummary:
    """What a run's proposer did and cost, for summary.json."""

    name: str
    model: str | None = None  # the model that answered
    origin: str | None = None  # what answered: `model`, `manual` (people) or `scripted` (a stand-in)
    calls: int = 0  # requests to the server; more than proposals if answers were refused
    call_failures: Mapping[str, int] = field(default_factory=dict[str, int])  # failed calls by kind
    input_tokens: int = 0  # tokens of all prompts
    output_tokens: int = 0  # tokens of all answers
    cost_usd: float | None = None  # cost; None if a price is unknown
    call_seconds: float = 0.0  # time of all calls together
    # Further entries of the record, such as where a replay differs from its source
    notes: Mapping[str, Any] = field(default_factory=dict[str, Any])
