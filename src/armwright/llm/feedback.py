"""Past designs as prompts show them (docs/method.md §6)."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from armwright.llm.answer import MAX_REASON_LENGTH
from armwright.llm.answer_format import NOTHING, SINGLE, module_lists
from armwright.pareto import NOT_EVALUATED
from armwright.problem.branches import branches_of
from armwright.problem.evaluation import Evaluation
from armwright.problem.unreached_reason import AT_LIMIT, unreached_reason
from armwright.proof.attribution import hypervolume_gains
from armwright.robot.arm import GRAVITY
from armwright.runs.history import BBO, History
from armwright.runs.trial import FinishedTrial
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.parameters import Design, ParameterValue
from armwright.text import one_line

N_PARETO = 5  # front members shown
N_RANDOM = 5  # other finished designs shown
N_LATEST = 3  # of the proposer's own designs, the latest ones shown
FINE = 4  # decimals of lengths [m]: a base 1 mm off a symmetry plane may lead to another posture
LARGE = 1e6  # from which numbers are written with an exponent
NOISE = 1e-9  # below it a number counts as 0

Record = Mapping[str, Any]
T = TypeVar("T")


@dataclass(frozen=True)
class Digits:
    """Numbers of decimals in a prompt: three, or more if the problem's scale is small."""

    length: int  # of lengths and positions [m]
    torque: int  # of torques [N m]
    objectives: tuple[int, ...]  # of each objective
    shares: tuple[int, ...]  # of each objective that has a value per target

    @classmethod
    def of(cls, history: History) -> "Digits":
        """Derive the decimals from the space's longest arm and the largest objectives so far."""
        space = history.problem.space
        reach = history.problem.max_reach
        task = history.problem.task
        weight = space.max_joints * space.heaviest_link + task.tool.mass + 2.0 * float(task.payloads.max())
        heaviest = GRAVITY * reach * weight  # [N m], more than any torque
        largest = np.abs(history.values).max(axis=0, initial=0.0, where=np.isfinite(history.values)).tolist()
        rough = [value if value > 1e-6 else 0.0 for value in largest]  # as float32 is, in metres
        objectives = tuple(max(3, _decimals(v)) for v in rough)
        return cls(
            max(3, _decimals(space.link[1])),
            max(2, _decimals(heaviest / 2)),
            objectives,
            tuple(n for n, o in zip(objectives, history.problem.objectives, strict=True) if o.is_of_targets),
        )


class Feedback:
    """A random sample of the front and of the other finished designs, and the proposer's latest ones, as text.

    Attributes:
        front: trial numbers of front members, sorted by the first objective; if no design is feasible, those of the
            designs with the smallest violations.
        others: trial numbers of other designs, in the order of the run.
        n_others: number of designs that `others` were drawn from.
        latest: trial numbers of the latest designs of the proposer, in the order of the run.
    """

    def __init__(self, history: History, seed: int, name: str = "") -> None:
        rng = np.random.default_rng(seed)
        front = [member.number for member in history.front] or history.nearest(N_PARETO)
        on_front = set(front)
        drawn_from = [trial.number for trial in history if trial.number not in on_front]
        self.n_others = len(drawn_from)
        self.front = draw_in_order(front, N_PARETO, rng)
        self.others = draw_in_order(drawn_from, N_RANDOM, rng)
        self.latest = [trial.number for trial in history if trial.source == name][-N_LATEST:]
        self.name = name
        self._history = history
        shown = dict.fromkeys([*self.front, *self.others, *self.latest])
        self._rows = {number: row for row, number in enumerate(shown)}
        self.digits = Digits.of(history)
        if self._rows:
            self._evaluation = history.evaluation(list(self._rows))
            entry = history.entry(list(self._rows))
            self._branches = branches_of(history.problem, history.matrix(list(self._rows)), entry)
            shares = [o.shares(self._evaluation) for o in history.problem.objectives if o.is_of_targets]
            shape = (*self._evaluation.position_error.shape, 0)
            self._each = np.stack(shares, axis=-1) if shares else np.empty(shape)  # (n, T, objectives with shares)

    def records(self, numbers: Sequence[int], targets: Sequence[int]) -> list[Record]:
        """Return the parameters and results of designs, by trial number, at the targets of these indices."""
        return [self._record(number, list(targets)) for number in numbers]

    def _record(self, number: int, shown: list[int]) -> Record:
        row = self._rows[number]
        evaluation, at = self._evaluation, self.digits
        joints = _joint_labels(self._history, number)
        return {
            **_parameters(self._history, number, at.length),
            "e_each": points(self._each[row, shown], at.shares) if at.shares else "",
            "p_ik": points(evaluation.reached[row, shown], at.length),
            "a_ik": _angles(evaluation, row, shown),
            "unreached": self._unreached(number, row, shown),
            "q_ik": points(evaluation.q[row, shown, : len(joints)], at.length),
            "tau_ik": points(evaluation.motor_torques[row, shown, : len(joints)], at.torque),
            "limits": _limits(evaluation, row, joints),
            "branches": str(self._branches[row]) if self._branches else "",
            "load": _load(evaluation.motor_torques[row], joints),
            "e_all": _objectives(self._history.trials[number], at),
            "violated": _violated(self._history, number),
        }

    def _unreached(self, number: int, row: int, shown: list[int]) -> str:
        """Explain unreached targets by the numbers shown; empty for positions, which the other lists explain."""
        if not self._evaluation.target_arrays.oriented:
            return ""
        arm = self._history.problem.arm(self._history.trials[number].design)
        reasons = [unreached_reason(arm, self._evaluation, row, target) for target in shown]
        return "; ".join(f"target {k} by {why}" for k, why in enumerate(reasons, start=1) if why) or "none"


def design_lines(history: History, numbers: Sequence[int], name: str) -> list[Record]:
    """Return the parameters, objectives and hypervolume gained of designs, without their postures.

    Those of the proposer `name` are marked as its own.
    """
    at, gains = Digits.of(history), hypervolume_gains(history)
    front = {member.number for member in history.front}
    own = {name: "you", BBO: "black box"}
    return [
        {
            **_parameters(history, number, at.length),
            "source": own.get(history.trials[number].source, history.trials[number].source.replace("_", " ")),
            "e_all": _objectives(history.trials[number], at),
            "gained": None if gains is None else _number(float(gains[number]), max(at.objectives)),
            "violated": _violated(history, number),
            "on_front": number in front,
        }
        for number in numbers
    ]


def points(rows: NDArray[np.float64], decimals: int | Sequence[int] = 3) -> str:
    """Format an array (N, M) as a list of vectors."""
    return "[" + ", ".join(vector(row, decimals) for row in rows) + "]"


def vector(values: Sequence[float] | NDArray[np.float64], decimals: int | Sequence[int] = 3) -> str:
    """Format numbers with the given decimals, one number for all or one for each."""
    each = [decimals] * len(values) if isinstance(decimals, int) else decimals
    return "(" + ", ".join(_number(float(value), n) for value, n in zip(values, each, strict=True)) + ")"


def _objectives(trial: FinishedTrial, at: Digits) -> str:
    """Format the objectives of a trial, or say why there are none."""
    if trial.failure is None:
        return vector(trial.values, at.objectives)
    return f"none, its evaluation failed ({one_line(trial.failure.description, MAX_REASON_LENGTH)})"


def _number(value: float, decimals: int) -> str:
    if not math.isfinite(value):
        return "not evaluated"
    if abs(value) >= LARGE:
        return f"{value:.4g}"
    return f"{round(value, decimals) + 0.0:.{decimals}f}"  # + 0.0 turns -0.0 into 0.0


def _decimals(scale: float) -> int:
    """Return the decimals that show three digits of a number of this size."""
    return 2 - math.floor(math.log10(scale)) if scale > NOISE else 3


def _parameters(history: History, number: int, decimals: int) -> dict[str, Any]:
    design, fine = history.trials[number].design, max(FINE, decimals)
    return {
        "number": number,
        "origin": vector(design.origin, decimals),
        "joints": "(" + ", ".join(design.joints) + ")",
        "links": vector(design.links, decimals),
        "fine_origin": vector(design.origin, fine),
        "fine_links": vector(design.links, fine),
        "extras": _extras(history.problem.space, design, decimals),
    }


def _violated(history: History, number: int) -> str:
    """Describe the violated constraints of a design; empty if the task has no constraints."""
    constraints = history.problem.constraints
    pairs = zip(constraints, history.trials[number].violations, strict=True)
    violated = [
        f"{c.quantity.symbol} not evaluated" if (has := c.measured(value)) is None
        else f"{c.quantity.symbol} = {has:.4g}, not {c.relation} {c.bound:.12g}"
        for c, value in sorted(pairs, key=lambda pair: pair[1] >= NOT_EVALUATED)
        if value > 0.0
    ]  # fmt: skip
    return ("; ".join(violated) or "none") if constraints else ""


def _extras(space: DesignSpace, design: Design, decimals: int) -> list[tuple[str, str]]:
    """Return the choices of a whole design and its lists besides joints and links, as lines of an answer."""

    def column(kind: str, digits: str) -> str:
        values = [design.params.get(f"{kind}_{j}", NOTHING) for j in range(1, len(design.joints) + 1)]
        return f"({', '.join(_text(value, digits) for value in values)})"

    lists = module_lists({parameter.name for parameter in space.parameters})
    return [
        *((name.upper(), str(design.params[name])) for name in SINGLE if name in design.params),
        *((group.upper(), column(kind, f".{decimals}f")) for group, kind in lists.items()),
        *(
            (name.upper(), _text(design.params[name], ".4g") if entry.per is None else column(name, ".4g"))
            for name, entry in space.custom
        ),
    ]


def _text(value: ParameterValue, digits: str) -> str:
    return value if isinstance(value, str) else f"{value:{digits}}"


def _joint_labels(history: History, number: int) -> list[str]:
    """Name each joint after its module, with a letter if the module has several joints."""
    modules = history.trials[number].design.module_of_joint
    return [
        f"joint_{module + 1}" + ("" if modules.count(module) == 1 else "abc"[modules[:j].count(module)])
        for j, module in enumerate(modules)
    ]


def _limits(evaluation: Evaluation, row: int, joints: Sequence[str]) -> str:
    """List the joints at their limits, with the number of targets."""
    lower, upper = evaluation.arms.lower[row], evaluation.arms.upper[row]
    q = evaluation.q[row]  # (T, D) [rad] or [m]
    at_limit: list[str] = []
    for j, name in enumerate(joints):
        for side, reached in (("upper", q[:, j] > upper[j] - AT_LIMIT), ("lower", q[:, j] < lower[j] + AT_LIMIT)):
            if reached.any():
                at_limit.append(f"{name} {side} at {int(reached.sum())} of {len(q)}")
    return ", ".join(at_limit) or "none"


def _angles(evaluation: Evaluation, row: int, shown: list[int]) -> str:
    """List the angle errors [deg], "-" for targets without orientation; empty if no target has one."""
    target_arrays = evaluation.target_arrays
    if not target_arrays.oriented:
        return ""
    degrees = np.degrees(evaluation.angle_error[row])
    return "(" + ", ".join(f"{degrees[t]:.1f}" if target_arrays.n_angular[t] else "-" for t in shown) + ")"


def _load(torques: NDArray[np.float64], joints: Sequence[str]) -> str:
    """List each joint's share of the absolute torques (T, D) [N m], summed over the targets."""
    carried = np.abs(torques).sum(axis=0)
    if not carried.any():
        return "no torque at any joint"
    shares = 100.0 * carried / carried.sum()
    return ", ".join(f"{name} {share:.0f} %" for name, share in zip(joints, shares, strict=False))


def draw_in_order(items: Sequence[T], n: int, rng: np.random.Generator) -> list[T]:
    """Draw `n` items without replacement, in their original order; all of them if there are fewer."""
    if len(items) <= n:
        return list(items)
    indices = rng.choice(len(items), size=n, replace=False)
    return [items[i] for i in sorted(indices.tolist())]
