"""Past designs as a prompt shows them: docs/method.md §6."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armwright.evaluation import Evaluation
from armwright.history import History

N_PARETO = 5  # members of the front shown
N_RANDOM = 5  # other finished designs shown
AT_LIMIT = 1e-3  # [rad] from a limit, from which a joint counts as standing at it

Record = Mapping[str, Any]


def drawn_designs(history: History, seed: int) -> tuple[list[int], list[int]]:
    """Numbers of members of the front, and of other finished trials, drawn without repetition."""
    rng = np.random.default_rng(seed)
    front = [member.number for member in history.front]
    others = [trial.number for trial in history if trial.number not in set(front)]
    return _draw(front, N_PARETO, rng), _draw(others, N_RANDOM, rng)


def design_records(history: History, numbers: Sequence[int], targets: Sequence[int]) -> list[Record]:
    """For each design its parameters, and what came of it at `targets` (places in the task's list), as text."""
    if not numbers:
        return []
    evaluation = history.evaluation(numbers)
    each = np.stack([objective.each(evaluation) for objective in history.problem.objectives], axis=-1)  # (n, T, M)
    shown = list(targets)
    return [
        {
            **_parameters(history, number),
            "e_each": points(each[row, shown]),
            "p_ik": points(evaluation.reached[row, shown]),
            "tau_ik": points(evaluation.joint_torques[row, shown], digits=4),
            "limits": _limits(history, evaluation, row),
            "load": _load(evaluation.joint_torques[row]),
            "e_all": vector(history.trials[number].values),
        }
        for row, number in enumerate(numbers)
    ]


def proposal_records(history: History, name: str) -> list[Record]:
    """The earlier designs of the proposer `name`: what it expected, what came out, and its reason."""
    front = {member.number for member in history.front}
    return [
        {
            **_parameters(history, trial.number),
            "expected": "not said" if trial.expected is None else vector(trial.expected),
            "e_all": vector(trial.values),
            "on_front": trial.number in front,
            "reason": trial.reason or "not said",
        }
        for trial in history
        if trial.source == name
    ]


def points(rows: NDArray[np.float64], digits: int = 3) -> str:
    """Rows of numbers as text."""
    return "[" + ", ".join(vector(row, digits) for row in rows) + "]"


def vector(values: Sequence[float] | NDArray[np.float64], digits: int = 3) -> str:
    """Numbers as text."""
    # + 0.0 turns -0.0 into 0.0
    return "(" + ", ".join(f"{round(float(value), digits) + 0.0:.{digits}f}" for value in values) + ")"


def _parameters(history: History, number: int) -> dict[str, Any]:
    design = history.trials[number].design
    return {
        "number": number,
        "origin": vector(design.origin),
        "joints": "(" + ", ".join(design.joints) + ")",
        "links": vector(design.links),
    }


def _limits(history: History, evaluation: Evaluation, row: int) -> str:
    """Which joints stand at which limit, and at how many of the targets."""
    lower, upper = history.problem.space.joint_range
    q = evaluation.q[row]  # (T, D) [rad]
    found: list[str] = []
    for j in range(q.shape[1]):
        for word, stands in (("upper", q[:, j] > upper - AT_LIMIT), ("lower", q[:, j] < lower + AT_LIMIT)):
            if stands.any():
                found.append(f"joint_{j + 1} {word} at {int(stands.sum())} of {len(q)}")
    return ", ".join(found) or "none"


def _load(torques: NDArray[np.float64]) -> str:
    """Each joint's share of the torques' absolute sum over the targets; torques: (T, D) [N m]."""
    carried = np.abs(torques).sum(axis=0)
    shares = 100.0 * carried / max(float(carried.sum()), 1e-12)
    return ", ".join(f"joint_{j + 1} {share:.0f} %" for j, share in enumerate(shares))


def _draw(numbers: Sequence[int], n: int, rng: np.random.Generator) -> list[int]:
    if len(numbers) <= n:
        return list(numbers)
    return sorted(rng.choice(np.array(numbers), size=n, replace=False).tolist())
