"""What the page shows of a run, as JSON and arrays."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armwright.pareto import NOT_EVALUATED, hypervolume
from armwright.problem.arm_quantities import TORQUE_SCALE, torque
from armwright.problem.assumptions import assumed_values
from armwright.problem.facts import ASKED, Facts, describe_supply
from armwright.problem.ignored_errors import describe_ignored_errors
from armwright.problem.objectives import QUANTITIES
from armwright.proof.cycle_faults import describe_path
from armwright.proof.design_record import DesignRecord, bounded_numbers
from armwright.proof.front_gap import known_front
from armwright.proof.infeasibility import describe_infeasibility
from armwright.runs.config import FrontMethod, RunConfig, describe_method
from armwright.runs.history import History
from armwright.spaces.joint_modules import DIRECTIONS, mounted_vector
from armwright.spaces.parameters import FloatParameter
from armwright.tasks.drawn_task import drawn_task
from armwright.tasks.task import Task

Arrays = Mapping[str, NDArray[Any]]
Summary = Mapping[str, Any] | None  # None if the run has not ended


@dataclass(frozen=True)
class ShownRun:
    """What the page shows of a run."""

    head: Mapping[str, Any]  # in JSON types
    arrays: Arrays  # one row for each design; `curve`: hypervolume after each design of the run


def show_run(config: RunConfig, history: History, summary: Summary, records: Mapping[int, DesignRecord]) -> ShownRun:
    """Return what the page shows of a run, with the records of its front."""
    head = {
        **_settings(config, history),
        "n": len(history),
        "front": [member.number for member in history.front],
        "arms": {  # the numbers by which `pick` selects, besides parameters and objectives
            number: {name: fact.value for name, fact in one.facts.items() if fact.value is not None}
            | bounded_numbers(history, number)
            for number, one in records.items()
        },
        "postures": {number: [target.shown for target in one.targets] for number, one in records.items()},
        "cycles": {
            number: one.motion.model_dump() | {"supply": describe_supply(one.facts)}
            for number, one in records.items()
            if one.motion is not None
        },
        "proposals": {
            trial.number: {
                "id": trial.answer,
                "reason": trial.reason,
                "fault": trial.fault,
                "screened": None if trial.screened is None else trial.screened.describe(history.problem.objectives),
            }
            for trial in history
            if trial.answer is not None or trial.fault is not None
        },
        "failures": {
            trial.number: f"{trial.failure.kind.replace('_', ' ')}: {trial.failure.description}"
            for trial in history
            if trial.failure is not None
        },
        "sources": list(dict.fromkeys(trial.source for trial in history)),
        "result": _result(history, summary),
        "recommended": _recommended((summary or {}).get("recommended", ()), records),
        "nothing": _why_nothing(history, summary),
    }
    return ShownRun(head, {**_designs(history), "curve": history.hypervolumes})


def shown_facts(facts: Facts) -> dict[str, dict[str, Any]]:
    """Return what an engineer asks of an arm, as far as it is known, by quantity."""
    return {
        name: {"value": fact.value, "text": fact.text, "label": fact.label, "description": fact.explanation}
        for name in ASKED
        if (fact := facts.get(name)) is not None and fact.value is not None
    }


def _settings(config: RunConfig, history: History) -> dict[str, Any]:
    """Return what the settings of a run mean."""
    task, space, problem = config.task, config.space, config.problem
    known, reference = known_front(problem), history.reference_point
    arrays = task.target_arrays
    return {
        "config": config.model_dump(mode="json"),
        "is_study": not isinstance(config.method, FrontMethod),
        "method": describe_method(config),
        **drawn_task(task),
        "payloads": task.payloads.tolist(),
        "cases": task.cases_description,
        "ignored_errors": describe_ignored_errors(problem),
        "tolerance": arrays.tolerance.tolist(),
        "angle_tolerance": arrays.angle_tolerance.tolist(),
        "is_oriented": arrays.oriented,
        "cycle": task.cycle_description,
        "motions": _motions(task),
        "is_closed": task.cycle is not None and task.cycle.closed,
        "reference_point": reference,
        "constraints": [
            {
                "description": constraint.description,
                "name": constraint.quantity.name,
                "unit": constraint.quantity.unit,
                "bound": constraint.bound,
                "sign": 1 if constraint.relation == "<=" else -1,
                "scale": constraint.scale,
            }
            for constraint in problem.constraints
        ],
        "torque_scale": TORQUE_SCALE if any(o.name == torque.name for o in config.objectives) else None,
        "parameters": [
            {
                "name": p.name,
                "needs": space.condition(p.name),
                "custom": p.name in space.custom_names,
                **({"unit": p.unit} if isinstance(p, FloatParameter) else {"choices": p.choices}),
            }
            for p in space.parameters
        ],
        "masses": space.mass_note,
        "is_toy": space.is_toy,
        "assumed": assumed_values(problem),
        "best_known": None if known is None or reference is None else known.hypervolume(reference),
        "asked": ASKED,
        "quantities": {
            name: {"label": one.label, "unit": one.unit, "description": one.explanation}
            for name, one in QUANTITIES.items()
        },
    }


def _motions(task: Task) -> list[dict[str, Any]]:
    """Return step, target and rest [s] of each motion of the cycle; empty without a cycle."""
    if task.cycle is None:
        return []
    plan = task.plan(task.target_positions)
    return [
        {"step": motion.step + 1, "target": plan.targets[motion.step], "rest": rest}
        for motion, rest in zip(plan.motions, plan.dwells, strict=True)
    ]


def _designs(history: History) -> Arrays:
    """Return arms, parameters and values of designs; `q`: (n, T, J) joint angles [rad] or strokes [m]."""
    problem, trials = history.problem, history.trials
    if not trials:
        return {}
    space = problem.space
    params = space.matrix([trial.design for trial in trials])
    arms = problem.arms(params)
    last = np.arange(len(trials)), arms.n_joints - 1
    offset = arms.offset.copy()
    offset[last] -= arms.tool.tip.astype(np.float32)
    q = np.zeros((len(trials), len(problem.task.targets), arms.dof), dtype=np.float32)
    angles = history.angles(range(len(trials)))[:, :, : arms.dof]
    q[:, :, : angles.shape[2]] = angles
    sources = list(dict.fromkeys(trial.source for trial in history))
    up = [mounted_vector(DIRECTIONS["+z"], space.mount_of(trial.design)) for trial in trials]
    arrays: dict[str, NDArray[Any]] = {
        "source": np.array([sources.index(trial.source) for trial in trials], dtype=np.uint8),
        "values": history.values,
        "params": params,
        "violations": np.where(history.violations < NOT_EVALUATED, history.violations, np.nan),
        "q": q,
        "base": arms.base,
        "up": np.array(up, dtype=np.float32),
        "joints": arms.n_joints.astype(np.uint8),
        "motion": arms.motion.astype(np.uint8),
        "lower": arms.lower,
        "upper": arms.upper,
        "offset": offset,
        "radius": arms.radius,
        "tip": arms.tool.tip.astype(np.float32),
        "tool_axis": arms.tool_axis,
        "tool_side": arms.tool_side,
    }
    if (bodies := arms.motor_bodies) is not None:
        shape = bodies.shape.astype(np.uint8)  # 255 without a body
        arrays |= {"body_shape": shape, "body_half": bodies.half, "body_centre": bodies.centre}
    if arms.columns is not None:
        arrays["column_half"] = arms.columns
    return arrays


def _result(history: History, summary: Summary) -> dict[str, Any]:
    """Return the results of a run so far."""
    reference = history.reference_point
    final = hypervolume(history.masked_objectives, reference) if reference is not None and len(history) else None
    parts: Mapping[str, Any] = summary or {}
    search: Mapping[str, Any] = parts.get("search") or {}  # of a direct search
    return {
        "finished": summary is not None,
        "hypervolume": final if summary is None else summary["hypervolume"]["final"],
        "by_source": Counter(trial.source for trial in history),
        "seconds": search.get("seconds", sum(trial.seconds.get("total", 0.0) for trial in history)),
        "evaluations": search.get("evaluations", len(history)),
        "infeasible": search.get("infeasible", int((~history.feasible & ~history.failed).sum())),
        "failed": int(history.failed.sum()),
        "verdict": (parts.get("verification") or {}).get("verdict"),
        "search": search.get("hypervolume_history"),
    }


def _recommended(recommended: Sequence[Mapping[str, Any]], records: Mapping[int, DesignRecord]) -> list[dict[str, Any]]:
    """Return the recommended designs, each once, with all its roles, its facts, and its loads along the cycle."""
    found: dict[int, dict[str, Any]] = {}
    for one in recommended:
        number = one["design"]
        if number not in found:
            record = records[number]
            found[number] = {key: one[key] for key in ("design", "status", "survival", "costs")} | {
                "roles": [],
                "facts": shown_facts(record.facts),
                "path": describe_path(record.path),
                "loads": None if record.loads is None else record.loads.model_dump(),
            }
        found[number]["roles"].append(one["role"])
        found[number]["costs"] = found[number]["costs"] or one["costs"]
    return list(found.values())


def _why_nothing(history: History, summary: Summary) -> dict[str, Any] | None:
    """Return why no design of a run with constraints is feasible, and the nearest one; None if one is feasible."""
    if not history.problem.constraints or not len(history) or history.feasible.any():
        return None
    (number,) = history.nearest(1)
    return {"nearest": number, "description": describe_infeasibility(history, (summary or {}).get("feasibility"))}
