"""Rules for any Optuna study: proposals without a model, from what the best trials have in common and lack.

What the rules for arms do with joints and links (`proposers/rules.py`), in terms of parameters alone: gaps of the front
are filled, its ends are carried on, choices are exchanged with the parameters that hang on them.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import optuna
from numpy.typing import NDArray
from optuna.distributions import BaseDistribution, CategoricalDistribution
from optuna.trial import FrozenTrial, TrialState

from armwright.exceptions import DesignError, ProposalError
from armwright.pareto import penalised_objectives
from armwright.proposers.for_optuna.parameters import Space, checked_value, stated_space, value_text
from armwright.proposers.for_optuna.proposer import StudyProposal, StudyProposer
from armwright.proposers.for_optuna.trials import best_trials, minimised, violation
from armwright.proposers.for_optuna.unit_interval import from_unit, is_number, to_unit
from armwright.proposers.rule_helpers import MIDDLE, change_until_new, draw_gap, proposal_id, rule_of

T = TypeVar("T")
Params = dict[str, Any]
Made = tuple[Params, str]  # parameters, and why

BEYOND = (0.2, 1.0)  # an end of the front, in steps from its neighbour to it
STRIDE = (0.02, 0.5)  # along a trend, of the range of the parameter that counts most
RIDGE = 1e-2  # of the trend's regression, times the number of trials
LONELY = 64  # points of which the one farthest from all trials is taken


@dataclass(frozen=True)
class Standing:
    """A study as the rules see it.

    complete: its complete trials with finite values, of which the space still holds a parameter.
    params: of each of these, as far as the space holds them: ranges may have changed.
    best: those of them that `best_trials` names, by rising first value; two at least, or none.
    tried: the parameters of all trials, those under way included.
    """

    space: Space
    complete: tuple[FrozenTrial, ...]
    params: tuple[Params, ...]
    values: NDArray[np.float64]  # (N, M), minimised; the infeasible ones behind all others
    best: tuple[int, ...]  # rows
    tried: tuple[Params, ...]
    name: str

    @cached_property
    def ranks(self) -> NDArray[np.float64]:
        """(N, M) the place of each trial in each objective, 0 for the best to below 1."""
        return self.values.argsort(axis=0, kind="stable").argsort(axis=0, kind="stable") / len(self.values)

    @property
    def n_objectives(self) -> int:
        """M."""
        return int(np.size(self.values, 1))

    @property
    def choices(self) -> list[str]:
        """The parameters that are choices, between two or more that can be told apart."""
        categories = {n: d for n, d in self.space.items() if isinstance(d, CategoricalDistribution)}
        return [n for n, d in categories.items() if len({value_text(choice, d) for choice in d.choices}) > 1]


class StudyRulesProposer(StudyProposer):
    """Trials by rules, for a study without a model; it needs no network and no key.

    Which rule comes next is drawn by how often each one's trials were on the front when they came (Thompson sampling).

    space: the parameters' distributions; None: those of the trials so far. What is given here goes before those.
    """

    name = "rules"

    def __init__(self, space: Space | None = None) -> None:
        self._space = dict(space or {})

    def space(self, study: optuna.Study) -> Space:
        """What was given, and what the trials have shown besides."""
        return stated_space(study, self._space)

    def propose(self, study: optuna.Study, seed: int, number: int) -> StudyProposal:
        """What one of the rules makes of the study's complete trials."""
        standing = standing_of(study, self.space(study), self.name)
        if not standing.space:
            raise ProposalError("space", "no trial has shown a parameter yet; give StudyRulesProposer(space=…)")
        rng = np.random.default_rng(seed)
        rule = most_promising(standing, rng)
        params, reason = RULES[rule](standing, rng)
        return StudyProposal(distinct(params, standing, rng), proposal_id(self.name, number, rule), reason)


def standing_of(study: optuna.Study, space: Space, name: str) -> Standing:
    """The study as it stands, to the proposer of this name."""
    trials = study.get_trials(deepcopy=False)
    finite = [t for t in trials if t.state == TrialState.COMPLETE and np.all(np.isfinite(t.values))]
    known = [(trial, params) for trial in finite if (params := held(trial.params, space))]
    complete = [trial for trial, _ in known]
    values = minimised(complete, study.directions)
    broken = in_order([violation(trial) for trial in complete])[:, None]
    chosen = {trial.number for trial in best_trials(complete, study.directions)}
    rows = [i for i in by_rising(values[:, 0]) if complete[i].number in chosen]
    if len(rows) < 2:  # a lonely best one has no neighbour but the next best
        rows = by_rising(penalised_objectives(values, broken)[:, 0])[:2] if len(complete) > 1 else []
    tried = tuple({**t.system_attrs.get("fixed_params", {}), **t.params} for t in trials)
    params = tuple(params for _, params in known)
    return Standing(space, tuple(complete), params, penalised_objectives(values, broken), tuple(rows), tried, name)


def in_order(violations: Sequence[float]) -> NDArray[np.float64]:
    """(N,) 0 for what is feasible, 1 for the least violation, 2 for the next, ...: some are infinite, or nearly so."""
    found = np.array(violations, dtype=np.float64)
    return np.searchsorted(np.unique(found[found > 0.0]), found, side="right").astype(np.float64)


def by_rising(values: NDArray[np.float64]) -> list[int]:
    """The rows of (N,) values, the least first."""
    order: list[int] = np.argsort(values, kind="stable").tolist()
    return order


def held(params: Mapping[str, Any], space: Space) -> Params:
    """What of a trial's parameters lies in the space; one that was enqueued may name what no trial has had."""
    found: Params = {}
    for name, value in params.items():
        try:
            if name in space:
                found[name] = checked_value(name, value, space[name])
        except DesignError:
            continue
    return found


def most_promising(standing: Standing, rng: np.random.Generator) -> str:
    """A rule, drawn by how many of its trials were on the front when they came."""
    if not standing.best:
        return "far"
    chances = {rule: float(rng.beta(1 + won, 1 + lost)) for rule, (won, lost) in record(standing).items()}
    return max(chances, key=lambda rule: chances[rule])


def record(standing: Standing) -> dict[str, tuple[int, int]]:
    """How many trials of each rule that can be used were on the front when they came, and how many were not."""
    counts = {rule: [0, 0] for rule in RULES if rule != "far"}
    if not standing.choices:
        del counts["swap"]
    if not any(is_number(distribution) for distribution in standing.space.values()):
        counts = {rule: counts[rule] for rule in ("cross", "swap") if rule in counts} or {"far": [0, 0]}
    for row, trial in enumerate(standing.complete):
        rule = rule_of(str(trial.user_attrs.get("proposal")))
        if trial.user_attrs.get("source") == standing.name and rule in counts:
            earlier, own = standing.values[:row], standing.values[row]
            beaten = bool(np.any(np.all(earlier <= own, axis=1)))
            counts[rule][beaten] += 1
    return {rule: (won, lost) for rule, (won, lost) in counts.items()}


def fill(standing: Standing, rng: np.random.Generator) -> Made:
    """Between two neighbours on the front, by chance: as the gap's square."""
    a, b = wide_gap(standing, rng)
    share = float(rng.uniform(*MIDDLE))
    return along(standing, a, b, share, rng), f"between trials {number(standing, a)} and {number(standing, b)}"


def extend(standing: Standing, rng: np.random.Generator) -> Made:
    """Beyond an end of the front, away from its neighbour there."""
    objective = int(rng.integers(standing.n_objectives))
    order = sorted(standing.best, key=lambda row: standing.values[row, objective])
    end, neighbour = order[0], order[1 + int(rng.integers(min(3, len(order) - 1)))]
    beyond = 1.0 + float(rng.uniform(*BEYOND))
    params = along(standing, end, neighbour, beyond, rng)
    return params, f"beyond trial {number(standing, end)}, as seen from trial {number(standing, neighbour)}"


def cross(standing: Standing, rng: np.random.Generator) -> Made:
    """Each parameter from one of two of the best."""
    a, b = (int(row) for row in rng.choice(standing.best, size=2, replace=False))
    params, other = dict(standing.params[a]), standing.params[b]
    params.update({name: other[name] for name in params if name in other and rng.random() < 0.5})
    return params, f"parameters of trials {number(standing, a)} and {number(standing, b)}"


def swap(standing: Standing, rng: np.random.Generator) -> Made:
    """One of the best with another choice, and with what hangs on that choice as the best trial with it has it."""
    row = int(rng.choice(standing.best))
    own = standing.params[row]
    name = one_of([choice for choice in standing.choices if choice in own] or standing.choices, rng)
    distribution = standing.space[name]
    assert isinstance(distribution, CategoricalDistribution)
    now = value_text(own[name], distribution) if name in own else None
    others = [choice for choice in distribution.choices if value_text(choice, distribution) != now]
    choice = one_of(others, rng)
    params = {**own, name: choice}
    alike = [i for i, p in enumerate(standing.params) if name in p and p[name] == choice]
    if alike:
        nearest = standing.params[min(alike, key=lambda i: standing.ranks[i].sum())]
        seen = {n for i in alike for n in standing.params[i]}
        params = {n: v for n, v in {**nearest, **params}.items() if n in seen}
    return params, f"trial {number(standing, row)} with {name} = {value_text(choice, distribution)}"


def trend(standing: Standing, rng: np.random.Generator) -> Made:
    """One of the best, moved to where a weighted rank of the values falls: the linear trend over trials like it."""
    score = standing.ranks @ rng.dirichlet(np.ones(standing.n_objectives))
    row = min(standing.best, key=lambda i: score[i])
    own = standing.params[row]
    names = [name for name in own if is_number(standing.space[name])]
    if not names:
        return cross(standing, rng)
    like = trials_like(standing, own, names)
    units = np.array([[unit(standing, i, name) for name in names] for i in like])  # (L, P)
    slope = linear(units, score[like])
    low, high = STRIDE
    stride = math.exp(rng.uniform(math.log(low), math.log(high))) / max(float(np.abs(slope).max()), 1e-300)
    moved = {
        name: from_unit(unit(standing, row, name) - stride * change, standing.space[name])
        for name, change in zip(names, slope.tolist(), strict=True)
    }
    return {**own, **moved}, f"trial {number(standing, row)} along the trend of {len(like)} trials"


def far(standing: Standing, rng: np.random.Generator) -> Made:
    """Far from all trials."""
    points = [{name: drawn(d, rng) for name, d in standing.space.items()} for _ in range(LONELY)]
    tried = [held(params, standing.space) for params in standing.tried]
    nearest = [min((distance(p, q, standing.space) for q in tried), default=0.0) for p in points]
    return points[int(np.argmax(nearest))], "far from all trials"


Rule = Callable[[Standing, np.random.Generator], Made]
RULES: dict[str, Rule] = {"fill": fill, "extend": extend, "cross": cross, "swap": swap, "trend": trend, "far": far}


def wide_gap(standing: Standing, rng: np.random.Generator) -> tuple[int, int]:
    """Two rows next to each other along one objective, by chance: as the square of the step between them."""
    rows = np.array(standing.best)
    values = standing.values[rows] / 2  # the whole span may be beyond the largest float
    span: NDArray[np.float64] = np.maximum(np.ptp(values, axis=0), 1e-300)
    pairs: list[tuple[int, int]] = []
    gaps: list[float] = []
    for m in range(values.shape[1]):
        order = np.argsort(values[:, m], kind="stable")
        pairs += zip(rows[order[:-1]].tolist(), rows[order[1:]].tolist(), strict=True)
        gaps += (np.diff(values[order, m]) / span[m]).tolist()
    return pairs[draw_gap(gaps, rng)]


def trials_like(standing: Standing, own: Params, names: Sequence[str]) -> list[int]:
    """The rows of trials that have these numbers; where there are enough, only those of the same choices as well."""
    like = [i for i, params in enumerate(standing.params) if all(name in params for name in names)]
    same = [i for i in like if all(standing.params[i].get(choice) == own.get(choice) for choice in standing.choices)]
    return same if len(same) > len(names) else like


def along(standing: Standing, a: int, b: int, share: float, rng: np.random.Generator) -> Params:
    """On the line from trial b (0) to a (1), with the parameters that a has; of two choices one, beyond them a's."""
    own, other = standing.params[a], standing.params[b]
    params = dict(own)
    for name in own:
        if name not in other:
            continue
        if is_number(standing.space[name]):
            to, start = unit(standing, a, name), unit(standing, b, name)
            params[name] = from_unit(start + share * (to - start), standing.space[name])
        elif share < 1.0 and rng.random() > share:
            params[name] = other[name]
    return params


def linear(units: NDArray[np.float64], score: NDArray[np.float64]) -> NDArray[np.float64]:
    """(P,) the slope of a linear fit of score (L,) over units (L, P), kept small where there are few."""
    centred = units - np.mean(units, axis=0)
    squares = centred.T @ centred + RIDGE * len(units) * np.eye(units.shape[1])
    return np.asarray(np.linalg.solve(squares, centred.T @ (score - score.mean())), dtype=np.float64)


def distinct(params: Params, standing: Standing, rng: np.random.Generator) -> Params:
    """Return the parameters, changed a little if they have been tried; the same if the space leaves no others."""

    def changed(params: Params, spread: float) -> Params:
        # Numbers are changed if there are any: another choice would be another proposal.
        name = one_of([n for n in params if is_number(standing.space[n])] or list(params), rng)
        distribution = standing.space[name]
        if is_number(distribution):
            share = to_unit(params[name], distribution) + rng.normal(0.0, spread)
            return {**params, name: from_unit(share, distribution)}
        return {**params, name: drawn(distribution, rng)}

    return change_until_new(params, lambda params: params in standing.tried, changed)


def drawn(distribution: BaseDistribution, rng: np.random.Generator) -> Any:
    """A value by chance."""
    if is_number(distribution):
        return from_unit(float(rng.random()), distribution)
    if isinstance(distribution, CategoricalDistribution):
        return one_of(distribution.choices, rng)
    return from_unit(0.0, distribution)  # of a single value


def one_of(things: Sequence[T], rng: np.random.Generator) -> T:
    """One by chance, as it is: numpy would make it its own, and cut names that end in NUL."""
    return things[int(rng.integers(len(things)))]


def distance(a: Mapping[str, Any], b: Mapping[str, Any], space: Space) -> float:
    """Mean distance over the parameters that both have, 0 to 1; 1 where they share none."""
    shared = [name for name in a if name in b]
    apart = [
        abs(to_unit(a[name], space[name]) - to_unit(b[name], space[name]))
        if is_number(space[name])
        else float(a[name] != b[name])
        for name in shared
    ]
    return float(np.mean(apart)) if apart else 1.0


def unit(standing: Standing, row: int, name: str) -> float:
    """Where in its range a trial's parameter lies."""
    return to_unit(standing.params[row][name], standing.space[name])


def number(standing: Standing, row: int) -> int:
    """The number of the trial in a row."""
    return standing.complete[row].number
