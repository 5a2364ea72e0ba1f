"""The content of the page: a run folder packed as bytes for the page's script.

report.html embeds these bytes; the live server sends them, reduced to what is new.
"""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armwright.existing.compare_arms import ComparedArm, dominance_counts, read_existing_arms
from armwright.experiments.run_record import describe_method
from armwright.kinematics.arms.arm_arrays import carrying
from armwright.kinematics.arms.forward import column_solid
from armwright.kinematics.arms.motor_bodies import NO_BODY, MotorBodies
from armwright.llm.transcript import TRANSCRIPTS, Transcript
from armwright.page.reach_maps import ReachMapFiles
from armwright.page.recommendations import explained, recommended_designs, shown, why_nothing
from armwright.page.repeat_command import repeat_command
from armwright.pareto import hypervolume
from armwright.pictures.style import EXISTING, FRONT, INFEASIBLE, JOINT, JOINT_LABEL, MISSED, OBSTACLE, TARGET, look
from armwright.problem.assumptions import assumed_values
from armwright.problem.facts import ASKED, Facts, describe_supply
from armwright.problem.ignored_errors import describe_ignored_errors
from armwright.problem.objectives import TORQUE_SCALE, torque
from armwright.proof.design_record import DesignRecord, read_records
from armwright.proof.front_gap import known_front
from armwright.proof.results import read_summary
from armwright.proof.selection import bounded_numbers
from armwright.robot.arm import AXES, Arm, Joint, Link
from armwright.robot.mjcf import to_mjcf
from armwright.robot.urdf_writer import to_urdf
from armwright.runs.config import FrontMethod, Method, RunConfig
from armwright.runs.folder import read_config
from armwright.runs.history import History
from armwright.runs.trials_file import TrialsReader
from armwright.sheet.record import NOT_MODELLED
from armwright.spaces.joint_modules import DIRECTIONS, mounted_vector
from armwright.spaces.parameters import FloatParameter
from armwright.tasks.obstacles import SHAPES
from armwright.tasks.task import Task

KINDS = ("revolute", "prismatic", "fixed")
NO_JOINT = Joint("fixed", "z")  # padding of shorter arms
NO_LINK = Link((0.0, 0.0, 0.0), 0.0, (0.0, 0.0, 0.0), 1.0)

Arrays = Mapping[str, NDArray[Any]]


class RunContent:
    """A run folder as the page shows it; `refresh` reads only what is new."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.config: RunConfig = read_config(folder)
        self._reader = TrialsReader(folder, self.config)
        self._reach_maps = ReachMapFiles(folder)
        self._chunks: list[tuple[int, Arrays]] = []  # chunks of designs, by the number of the first
        self._n = 0
        self._is_finished = False
        self._records: dict[int, DesignRecord] = {}  # of designs that are or were on the front
        self.history = self._nothing()
        self.refresh()

    def is_still(self, config: RunConfig) -> bool:
        """Return whether a folder with these settings holds the same run, possibly extended."""
        changing: dict[str, Any] = {"reference_point": None, "versions": {}, "earlier_versions": [], "method": None}
        ours, theirs = (one.model_copy(update=changing) for one in (self.config, config))
        return ours == theirs and type(self.config.method) is type(config.method)

    def refresh(self) -> bool:
        """Read what is new; return whether the trials file was replaced and had to be read from the start."""
        self.config = read_config(self.folder)  # the reference point may have been chosen since
        is_other = self._reader.read_on() or len(self._reader.trials) < self._n
        if is_other:
            self._chunks, self._n, self._records, self.history = [], 0, {}, self._nothing()
        summary = read_summary(self.folder)
        # A summary of another kind of run does not belong to this one.
        self.summary = summary if summary is not None and ("search" in summary) == (self.study is None) else None
        self.calls = Transcript(self.folder / TRANSCRIPTS, read_only=True).calls
        self.history = self.history.grown(self._reader.trials, self.config.reference_point)
        self._read_records()
        if len(self.history) > self._n:
            self._chunks.append((self._n, _designs(self.history, range(self._n, len(self.history)))))
            self._n = len(self.history)
        return is_other

    def _read_records(self) -> None:
        """Read the records of the front; those of a finished run are its results."""
        if self.summary is not None and not self._is_finished:
            self._records = {}
        self._is_finished = self.summary is not None
        front = [member.number for member in self.history.front]
        self._records |= read_records(self.folder, self.history, [n for n in front if n not in self._records])

    def _nothing(self) -> History:
        return History(self.config.problem, (), self.config.method.n_init, self.config.reference_point)

    @property
    def study(self) -> Method | None:
        """The settings of its study; None for a direct search."""
        return None if isinstance(self.config.method, FrontMethod) else self.config.method

    def packed(self, designs_from: int = 0, calls_from: int = 0, with_files: bool = True) -> bytes:
        """Pack the whole run, or only its new part.

        Args:
            designs_from: Number of the first new design.
            calls_from: Index of the first new call.
            with_files: Include URDF and MJCF of the designs on the front.
        """
        if designs_from not in {self._n, *(first for first, _ in self._chunks)}:
            designs_from = 0  # the page holds a state that was never sent: send everything
        arrays = _joined([arrays for first, arrays in self._chunks if first >= designs_from])
        front = [member.number for member in self.history.front]
        search = None if self.summary is None or self.study is not None else self.summary["search"]
        spent = None if search is None else search["evaluations"]
        reach_maps = self._reach_maps.read(self.history)
        records = {number: self._records[number] for number in front}
        chosen: Sequence[Mapping[str, Any]] = (self.summary or {}).get("recommended", ())
        existing = read_existing_arms(self.folder, len(self.history.problem.objectives))
        head = {
            **_about(self.config, self.folder, self.history, spent),
            "n": self._n,
            "designs_from": designs_from,
            "front": front,
            "arms": {number: _selectable(self.history, number, records[number].facts) for number in front},
            "cycles": {number: _cycle(record) for number, record in records.items() if record.motion is not None},
            "proposals": _proposals(self.history, designs_from),
            "failures": _failures(self.history, designs_from),
            "sources": list(dict.fromkeys(trial.source for trial in self.history)),
            "looks": {trial.source: look(trial.source)._asdict() for trial in self.history},
            "existing": EXISTING._asdict(),
            "existing_arms": [_existing_arm(arm, self.history) for arm in existing],
            "not_modelled": NOT_MODELLED,
            "reach_maps": {number: shown.head for number, shown in reach_maps.items()},
            "result": _result(self.history, self.summary),
            "recommended": recommended_designs(chosen, records),
            "asked": ASKED,
            "quantities": explained([*(record.facts for record in records.values()), *(arm.facts for arm in existing)]),
            "nothing": why_nothing(self.history, self.summary),
            "calls_from": calls_from,
            "calls": [asdict(call) for call in self.calls[calls_from:]],
            "files": {number: design_files(self.history, number) for number in front} if with_files else {},
        }
        levels = {f"reach_{number}": shown.levels for number, shown in reach_maps.items()}
        return pack(head, {**arrays, **levels, "curve": self.history.hypervolumes})


def _existing_arm(arm: ComparedArm, history: History) -> dict[str, Any]:
    """Return an existing arm and its relation to the present front."""
    return {
        "name": arm.name,
        "values": arm.values,
        "facts": shown(arm.facts),
        "violated": arm.violated,
        "dominance": dominance_counts(arm.values, arm.violated, history),
    }


def design_files(history: History, number: int) -> dict[str, str]:
    """Return a design as text for simulators, by format."""
    name, arm = f"{history.problem.task.name}-{number}", history.member(number).arm
    return {"urdf": to_urdf(arm, name), "mjcf": to_mjcf(arm, name)}


def _selectable(history: History, number: int, facts: Facts) -> dict[str, float]:
    """Return the quantities of a design of the front by which `pick` selects, besides parameters."""
    known = {name: fact.value for name, fact in facts.items() if fact.value is not None}
    return {**known, **bounded_numbers(history, number)}


def _cycle(record: DesignRecord) -> dict[str, Any]:
    """Return the motion of a design through the cycle, and its currents in words."""
    motion = {} if record.motion is None else record.motion.model_dump()
    return {**motion, "supply": describe_supply(record.facts)}


def _cycle_motions(task: Task) -> list[dict[str, Any]]:
    """Return step, target and rest [s] of each motion of the cycle; empty without a cycle."""
    if task.cycle is None:
        return []
    plan = task.plan(task.target_positions)
    return [
        {"step": motion.step + 1, "target": plan.targets[motion.step], "rest": rest}
        for motion, rest in zip(plan.motions, plan.dwells, strict=True)
    ]


def pack(head: Mapping[str, Any], arrays: Arrays) -> bytes:
    """Pack a JSON head and arrays: the head's length (uint32, little-endian), the head, then the arrays.

    The head's "arrays" holds the type, the offset after the head [bytes] and the shape of each array. Offsets are
    multiples of 8, so that a script can use the arrays in place.
    """
    places: dict[str, Any] = {}
    parts: list[bytes] = []
    at = 0
    for name, array in arrays.items():
        data = np.ascontiguousarray(array.astype(array.dtype.newbyteorder("<"))).tobytes()
        places[name] = [array.dtype.name, at, list(array.shape)]
        parts.append(data + b"\0" * (-len(data) % 8))
        at += len(parts[-1])
    head = {**head, "arrays": places}
    text = json.dumps(head, separators=(",", ":"), allow_nan=False, default=lambda array: array.tolist()).encode()
    text += b" " * (-(len(text) + 4) % 8)
    return len(text).to_bytes(4, "little") + text + b"".join(parts)


def _designs(history: History, numbers: range) -> Arrays:
    """Return the page's arrays of these designs, one row each; `q`: (n, T, J) joint angles [rad] or strokes [m]."""
    space = history.problem.space
    trials = [history.trials[number] for number in numbers]
    arms = [history.problem.arm(trial.design) for trial in trials]
    problem = history.problem
    arrays = carrying(problem.arms(space.matrix([trial.design for trial in trials])), problem.scenes[0].load_shape)
    q = np.zeros((len(trials), len(problem.task.targets), arrays.dof), dtype=np.float32)
    angles = history.angles(numbers)[:, :, : arrays.dof]
    q[:, :, : angles.shape[2]] = angles
    sources = list(dict.fromkeys(trial.source for trial in history))
    return {
        "source": np.array([sources.index(trial.source) for trial in trials], dtype=np.uint8),
        "values": history.values[numbers.start : numbers.stop],
        "params": space.matrix([trial.design for trial in trials]),
        "violations": history.violations[numbers.start : numbers.stop],
        "q": q,
        "up": np.array(
            [mounted_vector(DIRECTIONS["+z"], space.mount_of(trial.design)) for trial in trials], np.float32
        ),
        "com": arrays.com,
        "mass": arrays.mass,
        "payload_center": arrays.payload_center,
        **_arm_arrays(arms, arrays.dof),
        **_body_arrays(arrays.motor_bodies),
        **({} if space.column is None else {"column_half": _column_halves(arms)}),
    }


def _arm_arrays(arms: Sequence[Arm], room: int) -> Arrays:
    """Return the arms joint by joint, padded to J joints; `joints`: (n,) the number that an arm has."""
    joints = [arm.joints + (NO_JOINT,) * (room - len(arm.joints)) for arm in arms]
    links = [arm.links + (NO_LINK,) * (room - len(arm.links)) for arm in arms]

    def floats(rows: Any) -> NDArray[np.float32]:
        return np.array(rows, dtype=np.float32)

    return {
        "base": floats([arm.base for arm in arms]),
        "tip": floats([arm.tool.tip for arm in arms]),
        "tool_axis": floats([arm.tool.axis for arm in arms]),
        "tool_side": floats([arm.tool.side for arm in arms]),
        "joints": np.array([len(arm.joints) for arm in arms], dtype=np.uint8),
        "kind": np.array([[KINDS.index(j.kind) for j in row] for row in joints], dtype=np.uint8),
        "axis": np.array([[AXES.index(j.axis) for j in row] for row in joints], dtype=np.uint8),
        **{name: floats([[getattr(j, name) for j in row] for row in joints]) for name in ("lower", "upper", "travel")},
        "offset": floats([[link.offset for link in row] for row in links]),
        "radius": floats([[link.radius for link in row] for row in links]),
    }


def _body_arrays(bodies: MotorBodies | None) -> Arrays:
    """Return the motor bodies joint by joint; nothing if they do not count."""
    if bodies is None:
        return {}
    shape = np.where(bodies.shape == NO_BODY, len(SHAPES), bodies.shape).astype(np.uint8)
    return {"body_shape": shape, "body_half": bodies.half, "body_centre": bodies.centre}


def _column_halves(arms: Sequence[Arm]) -> NDArray[np.float32]:
    """Return radius, radius and half the length (n, 3) of the columns below the arms [m]; zeros without one."""
    solids = map(column_solid, arms)
    return np.array([(0.0, 0.0, 0.0) if solid is None else solid.half for solid in solids], dtype=np.float32)


def _joined(chunks: Sequence[Arrays]) -> dict[str, NDArray[Any]]:
    if not chunks:
        return {}
    return {name: np.concatenate([chunk[name] for chunk in chunks]) for name in chunks[0]}


def _about(config: RunConfig, folder: Path, history: History, spent: int | None) -> dict[str, Any]:
    """Return the head's slowly changing part; `spent`: evaluations of a direct search."""
    task, method, space = config.task, config.method, config.space
    known = known_front(config.problem)
    reference = history.reference_point
    return {
        "folder": folder.resolve().name,
        "config": config.model_dump(mode="json"),
        "is_study": not isinstance(method, FrontMethod),
        "targets": task.target_positions,
        "payloads": task.payloads,
        "cases": task.cases_description,
        "ignored_errors": describe_ignored_errors(config.problem),
        "obstacles": [asdict(obstacle.solid) | {"description": obstacle.describe()} for obstacle in task.obstacles],
        "target_arrays": asdict(task.target_arrays) | {"oriented": task.target_arrays.oriented},
        "workspace": [{"low": r.low, "high": r.high, "description": r.describe()} for r in task.workspace],
        "cycle": task.cycle_description,
        "lines": _lines(task),
        "motions": _cycle_motions(task),
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
            for constraint in config.problem.constraints
        ],
        "torque_scale": TORQUE_SCALE if any(o.name == torque.name for o in config.objectives) else None,
        "parameters": [
            {"name": p.name, "needs": space.condition(p.name), "custom": p.name in space.custom_names}
            | (
                {"low": p.low, "high": p.high, "unit": p.unit}
                if isinstance(p, FloatParameter)
                else {"choices": p.choices}
            )
            for p in space.parameters
        ],
        "masses": space.mass_note,
        "is_toy": space.is_toy,
        "assumed": assumed_values(config.problem),
        "method": describe_method(config),
        "command": repeat_command(config, folder, spent),
        "best_known": None if known is None or reference is None else known.hypervolume(reference),
        "colours": {
            "front": FRONT,
            "missed": MISSED,
            "target": TARGET,
            "joint": JOINT,
            "obstacle": OBSTACLE,
            "infeasible": INFEASIBLE,
        },
        "joint_labels": JOINT_LABEL,
    }


def _lines(task: Task) -> list[list[list[float]]]:
    """Return the ends [m] of the straight lines of the cycle."""
    if task.cycle is None:
        return []
    plan = task.plan(task.target_positions)
    ends = [(motion.start, motion.end) for motion in plan.motions if motion.by == "line"]
    return [plan.poses.position[list(pair)].tolist() for pair in ends]


def _result(history: History, summary: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return the results of the run so far; a finished run has a summary."""
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
        "robust": (parts.get("verification") or {}).get("robust_numbers"),
        "search": search.get("hypervolume_history"),
    }


def _failures(history: History, first: int) -> dict[int, str]:
    """Return why evaluations failed, of the designs from `first` on."""
    return {
        trial.number: f"{trial.failure.kind.replace('_', ' ')}: {trial.failure.description}"
        for trial in history.trials[first:]
        if trial.failure is not None
    }


def _proposals(history: History, first: int) -> dict[int, dict[str, Any]]:
    """Return the proposals, failed and screened ones included, among the designs from `first` on."""
    return {
        trial.number: {
            "id": trial.answer,
            "reason": trial.reason,
            "fault": trial.fault,
            "screened": None if trial.screened is None else trial.screened.describe(history.problem.objectives),
        }
        for trial in history.trials[first:]
        if trial.answer is not None or trial.fault is not None
    }
