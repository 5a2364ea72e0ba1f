"""The record of a design of the front: what is known of it, computed once and read by everything that shows it.

designs/NNNN/arm.urdf     for simulators
designs/NNNN/design.json  the record: facts, postures, errors and torques at every target, the motion through a cycle
designs/NNNN/arm.xml      for MuJoCo; with a cycle, the arm in its task (cycle_export.py)
designs/NNNN/trajectory.csv  with a cycle: its motion
"""

import json
import shutil
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Self, TypeVar

import numpy as np
from pydantic import BaseModel, model_validator
from pydantic_core import to_jsonable_python

from armwright.arrays import Array, finite_or_none
from armwright.exceptions import UnknownQuantityError
from armwright.files import MAX_DERIVED, read_text
from armwright.kinematics.cycle.motion_path import MotionPath
from armwright.pareto import NOT_EVALUATED
from armwright.problem.assumptions import assumed_values
from armwright.problem.branches import branches_of
from armwright.problem.evaluation import Evaluation
from armwright.problem.facts import VOLTAGE, Fact, Facts, alike, as_json, facts_of, reach_facts
from armwright.problem.objectives import QUANTITIES
from armwright.problem.over_reach import reach_lines
from armwright.problem.unreached_reason import unreached_reason
from armwright.proof.cycle_export import MODEL, cycle_files, trajectory_of
from armwright.proof.cycle_faults import Extreme, path_record
from armwright.proof.perturbations import Survival
from armwright.robot.arm import Arm, Joint
from armwright.robot.mjcf import to_mjcf
from armwright.robot.urdf_writer import to_urdf
from armwright.runs.folder import RunFolder
from armwright.runs.history import History
from armwright.runs.trial import FinishedTrial

T = TypeVar("T")

DESIGNS = "designs"
LINE_POINTS = (2, 3, 5, 9)  # of a motion, between which readers interpolate: as few as are near enough
NEAR = 5e-3  # [rad] or [m]
MOTION_DECIMALS = 3  # of joint values [rad] or [m] and of durations [s]
UNTIMED = 1.0  # [s] of each motion if durations are not known
INSTANTS = 160  # of a cycle, between which the largest load of each joint counts
LOAD_DIGITS = 4


class Motion(BaseModel, allow_inf_nan=False):
    """The motion of a design through the cycle of its task."""

    seconds: list[float]  # of each motion
    q: list[list[list[float]]]  # of each motion: points at equal shares, of each the joint values [rad] or [m]


class Loads(BaseModel, allow_inf_nan=False):
    """What the moving joints of a design bear along the cycle; torques with the safety factor."""

    seconds: float  # duration of the cycle
    torque: list[list[float]]  # of each joint, the largest at INSTANTS times [N m] or [N]
    speed: list[list[float]]  # likewise [rad/s] or [m/s]
    slides: list[bool]
    peak: list[float | None]  # limits; None where unknown
    continuous: list[float | None]
    no_load: list[float | None]

    @model_validator(mode="after")
    def _check(self) -> Self:
        """Check that all lists are of the same joints, and of the same times."""
        joints = {
            len(each) for each in (self.slides, self.peak, self.continuous, self.no_load, self.torque, self.speed)
        }
        times = set(map(len, [*self.torque, *self.speed]))
        if len(joints) > 1 or len(times) != 1 or times == {0}:
            raise ValueError("expected torques and speeds of all joints at the same times")
        return self


class TargetRecord(BaseModel, extra="allow", allow_inf_nan=False):
    """What a design does at a target, as far as others read it."""

    q: list[float]  # joint values [rad] or [m]
    unreached_reason: str | None
    joint_torques: list[float]  # [N m] or [N]

    @property
    def shown(self) -> dict[str, Any]:
        """What the page says of it."""
        torques = [float(f"{torque:.5g}") for torque in self.joint_torques]
        return {"reason": self.unreached_reason, "torques": torques}


class DesignRecord(BaseModel, extra="allow"):
    """What `design.json` says, as far as others read it."""

    number: int
    facts: dict[str, Fact]
    targets: list[TargetRecord]
    path: dict[str, Extreme | list[int]] | None = None  # where it is worst along the cycle (cycle_faults.py)
    motion: Motion | None = None
    loads: Loads | None = None  # of recommended designs
    survival: Survival | None = None  # whether it holds, if it was verified; None without constraints


def write_designs(
    folder: RunFolder,
    history: History,
    verdicts: Mapping[int, Mapping[str, Any]],
    recommended: Collection[int],
    survival: Mapping[int, Any],
) -> None:
    """Write the folders of designs of the front and of recommended ones; remove the others.

    verdicts, survival: What was found about designs, by number.
    """
    numbers = list(dict.fromkeys([*(member.number for member in history.front), *recommended]))
    names = {design_name(number) for number in numbers}
    for stale in (folder.path / DESIGNS).glob("[0-9]*"):
        if stale.name not in names:
            shutil.rmtree(stale)
    for number, arm, evaluation, row, record in _records(history, numbers, recommended):
        place, name = f"{DESIGNS}/{design_name(number)}", f"{history.problem.task.name}-{number}"
        folder.write_text(f"{place}/arm.urdf", to_urdf(arm, name))
        files = cycle_files(history.problem, arm, evaluation, row, name) or {MODEL: to_mjcf(arm, name)}
        for file, text in files.items():
            folder.write_text(f"{place}/{file}", text)
        if number in verdicts:
            record["verification"] = verdicts[number]
        if number in survival:
            record["survival"] = to_jsonable_python(survival[number])
        folder.write_text(f"{place}/design.json", json.dumps(record, indent=2) + "\n")


def design_name(number: int) -> str:
    """Return the name of a design's folder."""
    return f"{number:04d}"


def read_records(folder: Path, history: History, numbers: Sequence[int]) -> dict[int, DesignRecord]:
    """Return the records of designs by number; those that the folder lacks, as of a running run, are computed."""
    found: dict[int, DesignRecord] = {}
    for number in numbers:
        try:
            text = read_text(folder / DESIGNS / design_name(number) / "design.json", MAX_DERIVED, ValueError)
            record = DesignRecord.model_validate_json(text)
        except ValueError:  # none, or a damaged one; pydantic's errors included
            continue
        if _is_of(record, history, number):
            found[number] = record
    return found | compute_records(history, [number for number in numbers if number not in found])


def compute_records(
    history: History, numbers: Sequence[int], recommended: Collection[int] = ()
) -> dict[int, DesignRecord]:
    """Return the records of designs by number."""
    records = _records(history, numbers, recommended)
    return {number: DesignRecord.model_validate(record) for number, _, _, _, record in records}


def facts_by_number(records: Mapping[int, DesignRecord]) -> dict[int, Facts]:
    """Return the facts of records."""
    return {number: record.facts for number, record in records.items()}


def compute_facts(history: History, numbers: Sequence[int]) -> dict[int, Facts]:
    """Return the facts of designs by number."""
    found: dict[int, Facts] = {}
    for group in _alike(history, numbers):
        found |= zip(
            group, facts_of(history.evaluation(group), [history.member(number).arm for number in group]), strict=True
        )
    return found


def _is_of(record: DesignRecord, history: History, number: int) -> bool:
    """Return whether a record is of this design, whose number another may have had, and states all that it should."""
    params = (record.model_extra or {}).get("params")
    is_design = record.number == number and params == dict(history.trials[number].design.params)
    return is_design and record.facts.keys() >= {*QUANTITIES, VOLTAGE} and _fits(record, history, number)


def _fits(record: DesignRecord, history: History, number: int) -> bool:
    """Return whether targets and motion of a record are those of the task, and of the joints of the design."""
    plan, joints = history.problem.scenes[0].plan, len(history.member(number).arm.joints)
    motion, sizes = record.motion, {len(values) for one in record.targets for values in (one.q, one.joint_torques)}
    if len(record.targets) != len(history.problem.task.target_positions) or sizes != {joints}:
        return False
    if plan is None or motion is None:
        return plan is None and motion is None
    is_whole = len(motion.seconds) == len(motion.q) == len(plan.motions)
    return is_whole and all(len(points) > 1 and all(len(q) == joints for q in points) for points in motion.q)


def _alike(history: History, numbers: Sequence[int]) -> list[list[int]]:
    """Return the numbers of designs in groups of which the same is known."""
    designs = [history.trials[number].design for number in numbers]
    return [[numbers[row] for row in rows] for rows in alike(history.problem, designs)] if designs else []


def _records(
    history: History, numbers: Sequence[int], recommended: Collection[int]
) -> Iterator[tuple[int, Arm, Evaluation, int, dict[str, Any]]]:
    """Yield numbers of designs, their arms, evaluations with the row, and their records in JSON types."""
    payload = float(history.problem.task.payloads.max())
    for group in _alike(history, numbers):
        evaluation = history.evaluation(group)
        arms = [history.member(number).arm for number in group]
        for row, (number, arm, facts) in enumerate(zip(group, arms, facts_of(evaluation, arms), strict=True)):
            extra: dict[str, Any] = {}
            if number in recommended:
                facts = {**reach_facts(arm, reach_lines(arm, payload)[-1]), **facts}
                extra["loads"] = _loads(arm, evaluation, row)
                if branches := branches_of(history.problem, history.matrix([number]), history.entry([number])):
                    extra["branches"] = asdict(branches[0])
            record = _record(history, number, arm, evaluation, row) | {"facts": as_json(facts), **extra}
            yield number, arm, evaluation, row, record


def _record(history: History, number: int, arm: Arm, evaluation: Evaluation, row: int) -> dict[str, Any]:
    trial = history.trials[number]
    assumed = assumed_values(history.problem, [arm])
    return {
        "number": number,
        "source": trial.source,
        "reason": trial.reason,
        "params": dict(trial.design.params),
        "objectives": objective_record(history, [*map(finite_or_none, trial.values)]),
        **({"violations": violation_record(history, trial)} if trial.violations else {}),
        "masses": history.problem.space.mass_note,
        **({"assumed": assumed} if assumed else {}),
        **path_record(evaluation, row),
        **({} if evaluation.cycle_paths is None else {"motion": _motion(evaluation, row, len(arm.joints))}),
        "targets": [_target_record(evaluation, row, t, arm) for t in range(len(evaluation.targets))],
    }


def _target_record(evaluation: Evaluation, row: int, target: int, arm: Arm) -> dict[str, Any]:
    """Return the posture of an arm, which is row `row` of an evaluation, at a target."""
    angle_error = float(evaluation.angle_error[row, target])
    return {
        "target": evaluation.targets[target].tolist(),
        "q": evaluation.q[row, target, : len(arm.joints)].tolist(),
        "reached": evaluation.reached[row, target].tolist(),
        "position_error": float(evaluation.position_error[row, target]),
        **({"angle_error": angle_error} if evaluation.target_arrays.n_angular[target] else {}),
        "unreached_reason": unreached_reason(arm, evaluation, row, target) or None,
        "joint_torques": evaluation.joint_torques[row, target, : len(arm.joints)].tolist(),
    }


def _motion(evaluation: Evaluation, row: int, joints: int) -> dict[str, Any]:
    """Return the motion of an arm through the cycle, with its number of joints."""
    _, paths = evaluation.paths.of_arm(row)
    try:
        seconds = np.nan_to_num(evaluation.loads.durations[row], nan=UNTIMED)
    except UnknownQuantityError:
        seconds = np.full(len(paths), UNTIMED)
    return {
        "seconds": np.round(seconds, MOTION_DECIMALS).tolist(),
        "q": [np.round(_points(path)[:, :joints], MOTION_DECIMALS).tolist() for path in paths],
    }


def _points(path: MotionPath) -> Array:
    """Return (F, D) joint values of one arm at equal shares, between which the path is nearly straight."""
    n = next((n for n in LINE_POINTS if _distance(path, n) <= NEAR), LINE_POINTS[-1])
    return path.at(np.linspace(0.0, 1.0, n))[0]


def _distance(path: MotionPath, n: int) -> float:
    """Return the largest distance of a joint [rad] or [m] from straight lines between n points of its path."""
    points, at = path.at(np.linspace(0.0, 1.0, n))[0], path.share * (n - 1)
    before = np.minimum(at.astype(np.intp), n - 2)
    part = (at - before)[:, None]
    straight = (1.0 - part) * points[before] + part * points[before + 1]
    return float(np.abs(straight - path.q[0]).max())


def _loads(arm: Arm, evaluation: Evaluation, row: int) -> dict[str, Any] | None:
    """Return the loads of the moving joints; None without a cycle of known durations and drives."""
    joints = [joint for joint in arm.joints if joint.kind != "fixed"]
    if evaluation.plan is None or any(joint.actuator is None for joint in joints):
        return None
    try:
        trajectory = trajectory_of(arm, evaluation, row)
    except UnknownQuantityError:
        return None
    return {
        "seconds": float(trajectory.time[-1]),
        "torque": _thinned(trajectory.tau * arm.safety_factor),
        "speed": _thinned(trajectory.qd),
        "slides": [joint.kind == "prismatic" for joint in joints],
        "peak": [joint.effort for joint in joints],
        "continuous": [_continuous(joint) for joint in joints],
        "no_load": [joint.speed for joint in joints],
    }


def _continuous(joint: Joint) -> float | None:
    """Return the torque [N m] or force [N] that a joint can hold forever; None if unknown."""
    torque = None if joint.actuator is None else joint.actuator.continuous_torque
    return None if torque is None else torque / joint.travel


def _thinned(rows: Array) -> list[list[float]]:
    """Return for each joint the value of largest size in each of INSTANTS parts of a trajectory (R, D)."""
    parts = np.array_split(rows, min(INSTANTS, len(rows)))
    largest = np.array([np.take_along_axis(p, np.abs(p).argmax(axis=0)[None], axis=0)[0] for p in parts])
    return [[float(f"{value:.{LOAD_DIGITS}g}") for value in column] for column in largest.T.tolist()]


def violation_record(history: History, trial: FinishedTrial) -> dict[str, float | None]:
    """Return the violations of a trial by constraint; None where not evaluated."""
    pairs = zip(history.problem.constraints, trial.violations, strict=True)
    return {c.description: value if value < NOT_EVALUATED else None for c, value in pairs}


def bounded_numbers(history: History, number: int) -> dict[str, float]:
    """Return the quantities of a design that the constraints bound, by name, as far as they were evaluated."""
    pairs = zip(history.problem.constraints, history.trials[number].violations, strict=True)
    return {c.quantity.name: has for c, violation in pairs if (has := c.measured(violation)) is not None}


def objective_record(history: History, values: Sequence[T]) -> dict[str, T]:
    """Return values by objective."""
    return {o.name: value for o, value in zip(history.problem.objectives, values, strict=True)}
