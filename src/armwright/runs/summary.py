"""What a summary.json has to hold, so that what reads it need not doubt it; more may stand there."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal, cast

from pydantic import BaseModel, Field, TypeAdapter

Count = Annotated[int, Field(ge=0, lt=2**63)]


class _Record(BaseModel, extra="allow", strict=True, allow_inf_nan=False):
    """Kept as it was read."""


class _Volume(_Record):
    reference_point: list[float]
    final: float | None


class _Curve(_Volume):
    mean: float | None
    history: list[float]


class _Standing(_Record):
    hypervolume: float
    share: float
    beyond: Count
    gain: float


class _Verification(_Record):
    robust: Count
    sensitive: Count
    robust_numbers: list[int]
    hypervolume_of_robust: float
    robust_from_any_start: Count
    hypervolume_worst_case: float


class _Attribution(_Record):
    trials: Count
    front: Count
    hypervolume_gained: float | None


class _Age(_Record):
    mean: float
    max: int


class _Overlap(_Record):
    ratio: float
    ratio_planned: float
    feedback_age: _Age | None


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
    overlap: _Overlap | None


class _SourceBias(_Record):
    lengths_5_cm: float
    base_on_symmetry_plane: float | None
    near_repeats: float


class _ProposerBias(_Record):
    proposer: _SourceBias | None
    black_box: _SourceBias | None


class _Refinement(_Record):
    rounds: Count
    in_vain: Count


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
    hypervolume_history: Annotated[list[_Point], Field(min_length=1)]
    infeasible: Count = 0


class _Summary(_Record):
    n_trials: Count
    by_source: dict[str, Count]
    best_known: _Standing | None
    front_size: Count
    verification: _Verification | None


class StudySummary(_Summary):
    """Of a study."""

    hypervolume: _Curve
    evaluations: Count
    duplicates: Count
    refine: _Refinement | None
    attribution: dict[str, _Attribution]
    proposer: _Proposer | None
    proposer_bias: _ProposerBias | None
    seconds: _Seconds


class SearchSummary(_Summary):
    """Of a search for the whole front."""

    hypervolume: _Volume
    search: _Search


_OF_STUDY, _OF_SEARCH = TypeAdapter(StudySummary), TypeAdapter(SearchSummary)


def checked_summary(content: Any) -> dict[str, Any]:
    """Validate and return the content of a summary.json; ValueError if it is none."""
    is_search = isinstance(content, dict) and "search" in content
    (_OF_SEARCH if is_search else _OF_STUDY).validate_python(content)
    return cast("dict[str, Any]", content)


@dataclass(frozen=True)
class ProposerSummary:
    """What a run's proposer did and cost, for summary.json.

    model: who answered.  origin: what answered: `model`, `manual` (people), `scripted` (a stand-in).
    calls, requests: questions, and requests to the server (more, where answers were refused).
    call_failures: failed calls by kind.
    cost_usd: None where a price is not known.
    seconds: of all calls together.
    notes: what else should be known, such as where a replay differs from its record.
    """

    name: str
    model: str | None = None
    origin: str | None = None
    calls: int = 0
    requests: int = 0
    call_failures: Mapping[str, int] = field(default_factory=dict[str, int])
    input_tokens: int = 0
    output_tokens: int = 0
    cost_usd: float | None = None
    seconds: float = 0.0
    notes: Mapping[str, Any] = field(default_factory=dict[str, Any])
