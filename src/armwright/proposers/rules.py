"""Rules that propose arms, without a model.

They know the structures that a designer would try, and forecast the position error and torque of each in all sizes.
They propose the one with the largest expected gain, and correct the forecasts by results. When changes to the designs
of the front promise more, they fill its wide gaps, change the axis of joints that hardly move, and shorten the links
that load the joints most.
"""

import numpy as np

from armwright.pareto import hypervolume
from armwright.problem.objectives import PAPER_OBJECTIVES
from armwright.problem.problem import Problem
from armwright.proposers.proposer import Proposal, Proposer
from armwright.proposers.rule_feedback import RULES, describe, members_inside
from armwright.proposers.rule_forecast import Candidates, candidates
from armwright.proposers.rule_helpers import change_until_new, proposal_id, rule_of
from armwright.runs.history import History
from armwright.spaces.parameters import Design

STRUCTURE = "structure"
# Prior gain of each rule that changes the front, as a share of the hypervolume.
EXPECTED = {"fill": 0.01, "trim": 0.002, "swap": 0.002}
FIRST_SIZE, MORE_SIZES = 0.25, (0.1, 1.0)  # of structures without a forecast: share of smaller sizes
SMALL = 1e-9


class RulesProposer(Proposer):
    """Proposes designs by rules of geometry, mechanics and feedback; needs no network and no key."""

    name = "rules"

    def __init__(self) -> None:
        self._known: tuple[Problem, Candidates] | None = None

    def propose(self, history: History, seed: int, number: int) -> Proposal:
        """Propose what promises the largest gain: a structure in some size, or a change to the front."""
        rng = np.random.default_rng(seed)
        structures, inside = self._candidates(history.problem), members_inside(history)
        mean = mean_gains(history, self.name) if inside else {"": 0.0}
        rule = max(mean, key=lambda rule: mean[rule])
        row, gain = most_promising(structures, history)
        opened = sum(t.source == self.name and rule_of(t.proposal) == STRUCTURE for t in history.proposed)
        screened = [t.screened for t in history if t.screened is not None and t.screened.source == self.name]
        opened += sum(rule_of(s.proposal) == STRUCTURE for s in screened)
        if gain <= mean[rule] and (not inside or (not can_forecast(history) and opened < len(structures.names))):
            row, gain = next_structure(structures, opened, rng), np.inf
        if gain > mean[rule]:
            rule, reason = STRUCTURE, explain(structures, row)
            design = with_custom(structures.designs[row], history, rng)
        else:
            design, reason = RULES[rule](history, inside, rng)
        return Proposal(distinct(design, history, rng), proposal_id(self.name, number, rule), reason)

    def _candidates(self, problem: Problem) -> Candidates:
        """Return the candidates for a problem, which are made once."""
        if self._known is None or self._known[0] is not problem:
            self._known = problem, candidates(problem)
        return self._known[1]


def with_custom(design: Design, history: History, rng: np.random.Generator) -> Design:
    """Return a structure with the custom parameters of a design of the front or, as often, of a random one."""
    space = history.problem.space
    if not space.custom:
        return design
    front = [member.design for member in history.front]
    if front and rng.random() < 0.5:
        return space.with_custom(design, front[rng.integers(len(front))])
    return space.with_custom(design, space.sample(1, int(rng.integers(2**31)))[0])


def can_forecast(history: History) -> bool:
    """Return whether the first objectives are position error and torque, and their bounds are known."""
    return history.problem.objectives[:2] == PAPER_OBJECTIVES and history.reference_point is not None


def most_promising(structures: Candidates, history: History) -> tuple[int, float]:
    """Return the row of the candidate with the largest expected gain, and this gain in hypervolume; 0 if unknown.

    With further objectives, the hypervolume is taken to grow in proportion to the area of the first two.
    """
    if not can_forecast(history) or history.reference_point is None:
        return 0, 0.0
    expected = structures.expected_gains(history)
    row = int(np.argmax(expected))
    gain = float(expected[row])
    if len(history.reference_point) > 2 and len(history):
        area = hypervolume(history.masked_objectives[:, :2], history.reference_point[:2])
        gain *= float(history.hypervolumes[-1]) / max(area, SMALL)
    return row, gain


def next_structure(structures: Candidates, opened: int, rng: np.random.Generator) -> int:
    """Return the row of the next structure, small at first and then of random size, in its lighter orientation."""
    name = structures.names[opened % len(structures.names)]
    rows = np.array([row for row, structure in enumerate(structures.structures) if structure.name == name])
    share = FIRST_SIZE if opened < len(structures.names) else float(rng.uniform(*MORE_SIZES))
    lengths = structures.forecast.length[rows]
    distance = np.abs(lengths - np.quantile(lengths, share))
    return int(rows[np.lexsort((structures.forecast.torque[rows], distance.round(9)))[0]])


def explain(structures: Candidates, row: int) -> str:
    """Return the reason for a candidate."""
    structure, found = structures.structures[row], structures.forecast
    return (
        f"{structure.name}: {structure.why}; {describe(structures.designs[row])}; "
        f"forecast: error {found.error[row]:.2f} m, torque {found.torque[row]:.2f}"
    )


def mean_gains(history: History, name: str) -> dict[str, float]:
    """Return the mean hypervolume gain of each rule that changes the front, its prior gain included."""
    volume = history.hypervolumes
    gain = np.diff(volume, prepend=0.0)
    added = {rule: [expected * float(volume[-1])] for rule, expected in EXPECTED.items()}
    for trial in history.proposed:
        rule = rule_of(trial.proposal)
        if trial.source == name and rule in added:
            added[rule].append(float(gain[trial.number]))
    if len(history.problem.space.joint_types) == 1:
        del added["swap"]  # no other axis
    if history.problem.objectives != PAPER_OBJECTIVES:
        del added["fill"]  # it reads the front as position error against torque
    return {rule: float(np.mean(gains)) for rule, gains in added.items()}


def distinct(design: Design, history: History, rng: np.random.Generator) -> Design:
    """Return the design, changed a little if it has been tried; the same if the space leaves no other."""

    def changed(design: Design, spread: float) -> Design:
        origin = np.array(design.origin) + rng.normal(0.0, spread, 3)
        links = np.array(design.links) * np.exp(rng.normal(0.0, spread, len(design.links)))
        return history.problem.space.clipped(origin, design.joints, links, design)

    tried = {trial.design for trial in history}
    return change_until_new(design, tried.__contains__, changed)
