"""Rules that propose trials for any Optuna study, without a model.

They do for parameters what `proposers/rules.py` does for joints and links: fill gaps of the front, extend its ends, and
exchange choices together with the parameters that depend on them.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
import optuna
from optuna.distributions import BaseDistribution, CategoricalDistribution

from armwright.arrays import Array
from armwright.proposers.for_optuna.parameter_values import from_unit, is_number, to_unit, value_text
from armwright.proposers.for_optuna.parameters import Space
from armwright.proposers.for_optuna.proposer import StudyProposal, StudyProposer
from armwright.proposers.for_optuna.study_view import Params, StudyView, params_in_space
from armwright.proposers.rule_helpers import MIDDLE, change_until_new, draw_gap, proposal_id, rule_of

T = TypeVar("T")
Suggestion = tuple[Params, str]  # parameters and the reason for them

BEYOND = (0.2, 1.0)  # extrapolation past an end of the front, as a share of the step from its neighbour
STRIDE = (0.02, 0.5)  # step along a trend, as a share of the range of the steepest parameter
RIDGE = 1e-2  # regularisation of the trend, per trial
N_CANDIDATES = 64  # random points from which the most remote is taken


class StudyRulesProposer(StudyProposer):
    """Proposes trials by rules; needs no network and no key.

    The rule is drawn by Thompson sampling: a rule succeeds if its trial was on the front when it finished.

    Args:
        space: distributions of the parameters; takes precedence over those observed in the study.
    """

    name = "rules"

    def __init__(self, space: Space | None = None) -> None:
        self.given_space = dict(space or {})

    def propose(self, study: optuna.Study, seed: int, number: int) -> StudyProposal:
        """Apply one of the rules to the study's complete trials."""
        view = StudyView.of(study, self.space(study), self.name)
        rng = np.random.default_rng(seed)
        rule = draw_rule(view, rng)
        params, reason = RULES[rule](view, rng)
        return StudyProposal(distinct(params, view, rng), proposal_id(self.name, number, rule), reason)


def draw_rule(view: StudyView, rng: np.random.Generator) -> str:
    """Draw a rule by Thompson sampling of its success rate."""
    if not view.best:
        return "far"
    rates = {rule: float(rng.beta(1 + won, 1 + lost)) for rule, (won, lost) in rule_successes(view).items()}
    return max(rates, key=lambda rule: rates[rule])


def rule_successes(view: StudyView) -> dict[str, tuple[int, int]]:
    """Count for each applicable rule the trials that were on the front when they finished, and the others."""
    counts = {rule: [0, 0] for rule in RULES if rule != "far"}
    if not view.choices:
        del counts["swap"]
    if not any(is_number(distribution) for distribution in view.space.values()):
        counts = {rule: counts[rule] for rule in ("cross", "swap") if rule in counts} or {"far": [0, 0]}
    for i, trial in enumerate(view.complete):
        rule = rule_of(str(trial.user_attrs.get("proposal")))
        if trial.user_attrs.get("source") == view.source and rule in counts:
            dominated = bool(np.any(np.all(view.values[:i] <= view.values[i], axis=1)))
            counts[rule][dominated] += 1
    return {rule: (won, lost) for rule, (won, lost) in counts.items()}


def fill(view: StudyView, rng: np.random.Generator) -> Suggestion:
    """Interpolate between two neighbours on the front; wide gaps are drawn more often."""
    a, b = draw_neighbours(view, rng)
    share = float(rng.uniform(*MIDDLE))
    return interpolate(view, a, b, share, rng), f"between trials {view.number(a)} and {view.number(b)}"


def extend(view: StudyView, rng: np.random.Generator) -> Suggestion:
    """Extrapolate past an end of the front, away from a neighbour of that end."""
    objective = int(rng.integers(len(view.values.T)))
    order = sorted(view.best, key=lambda i: view.values[i, objective])
    end, neighbour = order[0], order[1 + int(rng.integers(min(3, len(order) - 1)))]
    beyond = 1.0 + float(rng.uniform(*BEYOND))
    params = interpolate(view, end, neighbour, beyond, rng)
    return params, f"beyond trial {view.number(end)}, as seen from trial {view.number(neighbour)}"


def cross(view: StudyView, rng: np.random.Generator) -> Suggestion:
    """Take each parameter from one of two of the best trials."""
    a, b = (int(i) for i in rng.choice(view.best, size=2, replace=False))
    params, other = dict(view.params[a]), view.params[b]
    params.update({name: other[name] for name in params if name in other and rng.random() < 0.5})
    return params, f"parameters of trials {view.number(a)} and {view.number(b)}"


def swap(view: StudyView, rng: np.random.Generator) -> Suggestion:
    """Change a choice of one of the best trials; what depends on it comes from the best trial that made it."""
    parent = int(rng.choice(view.best))
    own = view.params[parent]
    name = draw([choice for choice in view.choices if choice in own] or view.choices, rng)
    distribution = view.space[name]
    assert isinstance(distribution, CategoricalDistribution)
    current = value_text(own[name], distribution) if name in own else None
    choice = draw([c for c in distribution.choices if value_text(c, distribution) != current], rng)
    params = {**own, name: choice}
    same_choice = [i for i, p in enumerate(view.params) if name in p and p[name] == choice]
    if same_choice:
        best = view.params[min(same_choice, key=lambda i: view.ranks[i].sum())]
        allowed = {n for i in same_choice for n in view.params[i]}
        params = {n: v for n, v in {**best, **params}.items() if n in allowed}
    return params, f"trial {view.number(parent)} with {name} = {value_text(choice, distribution)}"


def trend(view: StudyView, rng: np.random.Generator) -> Suggestion:
    """Move one of the best trials down the linear trend of a randomly weighted rank."""
    score = view.ranks @ rng.dirichlet(np.ones(len(view.values.T)))
    parent = min(view.best, key=lambda i: score[i])
    own = view.params[parent]
    names = [name for name in own if is_number(view.space[name])]
    if not names:
        return cross(view, rng)
    similar = similar_trials(view, own, names)
    units = np.array([[view.unit(i, name) for name in names] for i in similar])  # (L, P)
    slope = ridge_slope(units, score[similar])
    low, high = STRIDE
    stride = math.exp(rng.uniform(math.log(low), math.log(high))) / max(float(np.abs(slope).max()), 1e-300)
    moved = {
        name: from_unit(view.unit(parent, name) - stride * change, view.space[name])
        for name, change in zip(names, slope.tolist(), strict=True)
    }
    return {**own, **moved}, f"trial {view.number(parent)} along the trend of {len(similar)} trials"


def far(view: StudyView, rng: np.random.Generator) -> Suggestion:
    """Take the random point that is most remote from all trials."""
    points = [{name: random_value(d, rng) for name, d in view.space.items()} for _ in range(N_CANDIDATES)]
    tried = [params_in_space(params, view.space) for params in view.tried]
    nearest = [min((distance(p, q, view.space) for q in tried), default=0.0) for p in points]
    return points[int(np.argmax(nearest))], "far from all trials"


Rule = Callable[[StudyView, np.random.Generator], Suggestion]
RULES: dict[str, Rule] = {"fill": fill, "extend": extend, "cross": cross, "swap": swap, "trend": trend, "far": far}


def draw_neighbours(view: StudyView, rng: np.random.Generator) -> tuple[int, int]:
    """Draw two trials that are neighbours along one objective, by the square of the step between them."""
    best = np.array(view.best)
    values = view.values[best] / 2  # halved, since the whole span may overflow
    span: Array = np.maximum(np.ptp(values, axis=0), 1e-300)
    pairs: list[tuple[int, int]] = []
    gaps: list[float] = []
    for m in range(values.shape[1]):
        order = np.argsort(values[:, m], kind="stable")
        pairs += zip(best[order[:-1]].tolist(), best[order[1:]].tolist(), strict=True)
        gaps += (np.diff(values[order, m]) / span[m]).tolist()
    return pairs[draw_gap(gaps, rng)]


def similar_trials(view: StudyView, own: Params, names: Sequence[str]) -> list[int]:
    """Return the trials that have these numbers, with the same choices if there are enough of them."""
    similar = [i for i, params in enumerate(view.params) if all(name in params for name in names)]
    same = [i for i in similar if all(view.params[i].get(choice) == own.get(choice) for choice in view.choices)]
    return same if len(same) > len(names) else similar


def interpolate(view: StudyView, a: int, b: int, share: float, rng: np.random.Generator) -> Params:
    """Return the point on the line from trial `b` (share 0) to `a` (1), with the parameters of `a`.

    Each choice is drawn from the two trials; beyond `a` it is that of `a`.
    """
    own, other = view.params[a], view.params[b]
    params = dict(own)
    for name in own:
        if name not in other:
            continue
        if is_number(view.space[name]):
            end, start = view.unit(a, name), view.unit(b, name)
            params[name] = from_unit(start + share * (end - start), view.space[name])
        elif share < 1.0 and rng.random() > share:
            params[name] = other[name]
    return params


def ridge_slope(units: Array, score: Array) -> Array:
    """Return the slope (P,) of a ridge regression of score (L,) on units (L, P)."""
    centred = units - np.mean(units, axis=0)
    squares = centred.T @ centred + RIDGE * len(units) * np.eye(units.shape[1])
    return np.asarray(np.linalg.solve(squares, centred.T @ (score - score.mean())), dtype=np.float64)


def distinct(params: Params, view: StudyView, rng: np.random.Generator) -> Params:
    """Return the parameters, changed a little if they have been tried; the same if the space leaves no others."""

    def changed(params: Params, spread: float) -> Params:
        # Numbers are changed if there are any: another choice would be another proposal.
        name = draw([n for n in params if is_number(view.space[n])] or list(params), rng)
        distribution = view.space[name]
        if is_number(distribution):
            share = to_unit(params[name], distribution) + rng.normal(0.0, spread)
            return {**params, name: from_unit(share, distribution)}
        return {**params, name: random_value(distribution, rng)}

    return change_until_new(params, lambda params: params in view.tried, changed)


def random_value(distribution: BaseDistribution, rng: np.random.Generator) -> Any:
    """Draw a value, uniformly on the distribution's scale."""
    if isinstance(distribution, CategoricalDistribution):
        return draw(distribution.choices, rng)
    return from_unit(float(rng.random()) if is_number(distribution) else 0.0, distribution)


def draw(items: Sequence[T], rng: np.random.Generator) -> T:
    """Draw an item; `rng.choice` would convert it to a numpy type and truncate names that end in NUL."""
    return items[int(rng.integers(len(items)))]


def distance(a: Mapping[str, Any], b: Mapping[str, Any], space: Space) -> float:
    """Return the mean distance of the shared parameters, 0 to 1; 1 if there are none."""
    distances = [
        abs(to_unit(a[name], space[name]) - to_unit(b[name], space[name]))
        if is_number(space[name])
        else float(a[name] != b[name])
        for name in a
        if name in b
    ]
    return float(np.mean(distances)) if distances else 1.0
