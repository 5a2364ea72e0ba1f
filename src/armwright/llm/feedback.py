"""Past designs as a prompt shows them: docs/method.md §6."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from armwright.llm.answer import LONGEST_REASON
from armwright.llm.answer_format import LISTS, NOTHING
from armwright.problem.evaluation import Evaluation
from armwright.problem.miss_reasons import AT_LIMIT, why_missed
from armwright.robot.arm import GRAVITY
from armwright.runs.history import History
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.parameters import Design
from armwright.text import one_line

N_PARETO = 5  # members of the front shown
N_RANDOM = 5  # other finished designs shown
LARGE = 1e6  # from which on numbers are written with an exponent
NOISE = 1e-9  # below it a number counts as 0

Record = Mapping[str, Any]
T = TypeVar("T")


@dataclass(frozen=True)
class Digits:
    """Decimals that numbers are shown with: three, or more where a problem's own scale is small."""

    length: int
    torque: int
    objectives: tuple[int, ...]
    shares: tuple[int, ...]  # of those objectives of which each target has a share

    @classmethod
    def of(cls, history: History) -> "Digits":
        """By the space's longest arm, and by the largest objectives so far."""
        space = history.problem.space
        reach = space.max_reach
        weight = space.max_joints * space.mass.mass(space.link[1]) + 2.0 * float(history.problem.task.payloads.max())
        heaviest = GRAVITY * reach * weight  # [N m], more than any torque
        largest = np.abs(history.values).max(axis=0, initial=0.0).tolist()
        rough = [value if value > 1e-6 else 0.0 for value in largest]  # as float32 is, in metres
        objectives = tuple(max(3, _decimals(v)) for v in rough)
        with_shares = [objective.is_of_targets for objective in history.problem.objectives]
        return cls(
            max(3, _decimals(space.link[1])),
            max(2, _decimals(heaviest / 2)),
            objectives,
            tuple(decimals for decimals, shared in zip(objectives, with_shares, strict=True) if shared),
        )


class Feedback:
    """Members of the front and other finished designs, drawn by `seed`, as text.

    front, others: numbers of the trials; of the front by its first objective, else in the order of the run. As long as
        no design is feasible, what comes nearest to it stands in for the front.
    """

    def __init__(self, history: History, seed: int) -> None:
        rng = np.random.default_rng(seed)
        front = [member.number for member in history.front] or history.nearest(N_PARETO)
        on_front = set(front)
        others = [trial.number for trial in history if trial.number not in on_front]
        self.front = draw_in_order(front, N_PARETO, rng)
        self.others = draw_in_order(others, N_RANDOM, rng)
        self._history = history
        self.digits = Digits.of(history)
        numbers = [*self.front, *self.others]
        if numbers:
            self._evaluation = history.evaluation(numbers)
            shares = [o.each(self._evaluation) for o in history.problem.objectives if o.is_of_targets]
            shape = (*self._evaluation.position_error.shape, 0)
            self._each = np.stack(shares, axis=-1) if shares else np.empty(shape)  # (n, T, those that have shares)

    def records(self, numbers: Sequence[int], targets: Sequence[int]) -> list[Record]:
        """For each of these designs its parameters, and what came of it at `targets` (places in the task's list)."""
        return [self._record(number, list(targets)) for number in numbers]

    def _record(self, number: int, shown: list[int]) -> Record:
        row = [*self.front, *self.others].index(number)
        evaluation, at = self._evaluation, self.digits
        joints = _joint_labels(self._history, number)
        return {
            **_parameters(self._history, number, at.length),
            "e_each": points(self._each[row, shown], at.shares) if at.shares else "",
            "p_ik": points(evaluation.reached[row, shown], at.length),
            "a_ik": _angles(evaluation, row, shown),
            "missed": self._missed(number, row, shown),
            "tau_ik": points(evaluation.motor_torques[row, shown, : len(joints)], at.torque),
            "limits": _limits(evaluation, row, joints),
            "load": _load(evaluation.motor_torques[row], joints),
            "e_all": vector(self._history.trials[number].values, at.objectives),
            "broken": _broken(self._history, number),
        }

    def _missed(self, number: int, row: int, shown: list[int]) -> str:
        """Why targets are missed, counted as shown; empty for points alone, whose reasons stand in the other lists."""
        if not self._evaluation.target_arrays.oriented:
            return ""
        arm = self._history.problem.arm(self._history.trials[number].design)
        reasons = [why_missed(arm, self._evaluation, row, target) for target in shown]
        return "; ".join(f"target {k} by {why}" for k, why in enumerate(reasons, start=1) if why) or "none"


def proposal_records(history: History, name: str) -> list[Record]:
    """The earlier designs of the proposer `name`: what it expected, what came out, and its reason."""
    front = {member.number for member in history.front}
    at = Digits.of(history)
    return [
        {
            **_parameters(history, trial.number, at.length),
            "expected": "not said" if trial.expected is None else vector(trial.expected, at.objectives),
            "e_all": vector(trial.values, at.objectives),
            "broken": _broken(history, trial.number),
            "on_front": trial.number in front,
            "reason": one_line(trial.reason, LONGEST_REASON) or "not said",
        }
        for trial in history
        if trial.source == name
    ]


def points(rows: NDArray[np.float64], decimals: int | Sequence[int] = 3) -> str:
    """Rows of numbers as text."""
    return "[" + ", ".join(vector(row, decimals) for row in rows) + "]"


def vector(values: Sequence[float] | NDArray[np.float64], decimals: int | Sequence[int] = 3) -> str:
    """Numbers as text, with so many decimals (each)."""
    each = [decimals] * len(values) if isinstance(decimals, int) else decimals
    return "(" + ", ".join(_number(float(value), n) for value, n in zip(values, each, strict=True)) + ")"


def _number(value: float, decimals: int) -> str:
    if not abs(value) < LARGE:
        return f"{value:.4g}"
    return f"{round(value, decimals) + 0.0:.{decimals}f}"  # + 0.0 turns -0.0 into 0.0


def _decimals(scale: float) -> int:
    """That show three digits of a number of this size."""
    return 2 - math.floor(math.log10(scale)) if scale > NOISE else 3


def _parameters(history: History, number: int, decimals: int) -> dict[str, Any]:
    design = history.trials[number].design
    return {
        "number": number,
        "origin": vector(design.origin, decimals),
        "joints": "(" + ", ".join(design.joints) + ")",
        "links": vector(design.links, decimals),
        "extras": _extras(history.problem.space, design, decimals),
    }


def _broken(history: History, number: int) -> str:
    """The constraints that a design does not keep, with what it has instead; empty where the task has none."""
    constraints = history.problem.constraints
    words = [
        f"{c.quantity.symbol} = {c.measured(value):.4g}, not {c.relation} {c.bound:.12g}"
        for c, value in zip(constraints, history.trials[number].violations, strict=True)
        if value > 0.0
    ]
    return ("; ".join(words) or "none") if constraints else ""


def _extras(space: DesignSpace, design: Design, decimals: int) -> list[tuple[str, str]]:
    """What a design has beside base, joints and links, as the lines of an answer: name and value."""
    names = {parameter.name for parameter in space.parameters}
    found = [("MOUNT", design.mount)] if design.mount is not None else []
    for group, kind in LISTS.items():
        if group in ("joints", "links") or f"{kind}_1" not in names:
            continue
        values = [design.params.get(f"{kind}_{j}", NOTHING) for j in range(1, len(design.joints) + 1)]
        shown = [value if isinstance(value, str) else f"{value:.{decimals}f}" for value in values]
        found.append((group.upper(), f"({', '.join(shown)})"))
    return found


def _joint_labels(history: History, number: int) -> list[str]:
    """What each joint of a design's arm is called: as its module, of several there each with a letter."""
    places = history.trials[number].design.module_of_joint
    return [
        f"joint_{place + 1}" + ("" if places.count(place) == 1 else "abc"[places[:j].count(place)])
        for j, place in enumerate(places)
    ]


def _limits(evaluation: Evaluation, row: int, joints: Sequence[str]) -> str:
    """Which joints stand at which limit, and at how many of the targets."""
    lower, upper = evaluation.arms.lower[row], evaluation.arms.upper[row]
    q = evaluation.q[row]  # (T, D) [rad] or [m]
    found: list[str] = []
    for j, name in enumerate(joints):
        for word, stands in (("upper", q[:, j] > upper[j] - AT_LIMIT), ("lower", q[:, j] < lower[j] + AT_LIMIT)):
            if stands.any():
                found.append(f"{name} {word} at {int(stands.sum())} of {len(q)}")
    return ", ".join(found) or "none"


def _angles(evaluation: Evaluation, row: int, shown: list[int]) -> str:
    """By how many degrees the tool is off at targets, "-" where any direction will do; empty where no target asks."""
    target_arrays = evaluation.target_arrays
    if not target_arrays.oriented:
        return ""
    degrees = np.degrees(evaluation.angle_error[row])
    return "(" + ", ".join(f"{degrees[t]:.1f}" if target_arrays.n_angular[t] else "-" for t in shown) + ")"


def _load(torques: NDArray[np.float64], joints: Sequence[str]) -> str:
    """Each joint's share of the torques' absolute sum over the targets; torques: (T, D) [N m]."""
    carried = np.abs(torques).sum(axis=0)
    if not carried.any():
        return "no torque at any joint"
    shares = 100.0 * carried / carried.sum()
    return ", ".join(f"{name} {share:.0f} %" for name, share in zip(joints, shares, strict=False))


def draw_in_order(items: Sequence[T], n: int, rng: np.random.Generator) -> list[T]:
    """Draw `n` of the items without repetition, in their order; all of them if there are no more."""
    if len(items) <= n:
        return list(items)
    places = rng.choice(len(items), size=n, replace=False)
    return [items[place] for place in sorted(places.tolist())]
