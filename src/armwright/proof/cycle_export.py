"""The files of a design with a cycle: its model in its surroundings, and its trajectory."""

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from armwright.exceptions import SettingsError
from armwright.kinematics.arms.arm_arrays import FIXED, carrying, stack_arms
from armwright.kinematics.cycle.motion_path import MotionPath
from armwright.kinematics.cycle.trajectory import Trajectory, sample_trajectory
from armwright.problem.evaluation import Evaluation, evaluate
from armwright.problem.problem import Problem
from armwright.proof.simulation_model import to_simulation_mjcf
from armwright.robot.arm import Arm
from armwright.spaces.tool_mount import carrying_tool
from armwright.tasks.task import Task

MODEL, TRAJECTORY = "arm.xml", "trajectory.csv"
QUANTITIES = ("q", "qd", "qdd", "tau")  # of joints, in a trajectory
ALLOWED = "allowed_"  # columns of depths
DIGITS = 9


@dataclass(frozen=True)
class CycleModel:
    """An arm in its task."""

    mjcf: str  # the model, as XML
    trajectory: Trajectory  # its motion through the cycle

    def files(self, target_names: Sequence[str]) -> dict[str, str]:
        """Return the files of the model and of its trajectory, by name."""
        return {MODEL: self.mjcf, TRAJECTORY: trajectory_csv(self.trajectory, target_names)}


def cycle_files(problem: Problem, arm: Arm, evaluation: Evaluation, row: int, name: str) -> Mapping[str, str]:
    """Return the files of an arm, row `row` of an evaluation, by name; none without a cycle of known durations."""
    try:
        model = modelled(arm, problem.task.target_names, evaluation, row, name)
    except SettingsError:
        return {}
    return model.files(problem.task.target_names)


def cycle_model(arm: Arm, task: Task) -> CycleModel:
    """Return the model of an arm in its task for MuJoCo, and its trajectory through the cycle.

    Steps without a duration take the least time that the actuators of the arm allow. In the model, moving joints are
    joint_1, joint_2, …, each with the actuators servo_1, … (position) and ff_1, … (torque).

    Args:
        arm: The arm. The tool of the task is mounted on an arm that carries none.
        task: A task with a cycle.

    Raises:
        SettingsError: The task has no cycle, or a step of unknown duration.

    Examples:
        >>> import armwright as aw
        >>> task, space = aw.load_task("desk-sorting"), aw.load_space("desk-sorting")
        >>> model = aw.cycle_model(space.arm(space.sample(1, 1)[0]), task)
        >>> model.trajectory.q.shape[0] == len(model.trajectory.time)
        True
    """
    if task.cycle is None:
        raise SettingsError(f"task {task.name} has no cycle; try cycle: in_order")
    equipped = carrying_tool(arm, task.tool)
    return modelled(equipped, task.target_names, evaluate(equipped, task), 0, task.name)


def modelled(arm: Arm, target_names: Sequence[str], evaluation: Evaluation, row: int, name: str) -> CycleModel:
    """Return the model and the trajectory of an arm, which is row `row` of an evaluation; SettingsError without one."""
    trajectory = trajectory_of(arm, evaluation, row)
    peaks = np.abs(trajectory.tau).max(axis=0)
    return CycleModel(to_simulation_mjcf(arm, evaluation, target_names, evaluation.q[row], peaks, name), trajectory)


def trajectory_of(arm: Arm, evaluation: Evaluation, row: int) -> Trajectory:
    """Return the trajectory of an arm, row `row` of an evaluation; SettingsError without a cycle of known durations."""
    arrays = carrying(stack_arms([arm], "float64"), evaluation.load_shape)
    paths = tuple(
        MotionPath(path.motion, np.where(arrays.motion == FIXED, 0.0, path.q[..., : arrays.dof]))
        for path in evaluation.paths.of_arm(row)[1]
    )
    loads = evaluation.loads
    payload = float(evaluation.payload.max())
    return sample_trajectory(arrays, paths, evaluation.paths.plan, loads.durations[row], loads.dwells, payload)


def trajectory_csv(trajectory: Trajectory, target_names: Sequence[str]) -> str:
    """Return a trajectory as CSV, all joints' values after each other: q_1, …, qd_1, …, qdd_1, …, tau_1, ….

    target is the name of a target where the arm has reached it and rested there, else empty. allowed_1, … is how deep
    tool and payload may be in each obstacle [m]: -1 where they may not touch it, inf in a hole.
    """
    n = trajectory.q.shape[1]
    out = io.StringIO()
    columns = [f"{ALLOWED}{o}" for o in range(1, trajectory.allowed.shape[1] + 1)]
    columns += [f"{quantity}_{k}" for quantity in QUANTITIES for k in range(1, n + 1)]
    out.write(",".join(["time", "step", "target", "payload", *columns]) + "\n")
    values = np.hstack([getattr(trajectory, quantity) for quantity in ("allowed", *QUANTITIES)]) + 0.0  # no -0.0
    line = ",".join([f"%.{DIGITS}g"] * len(columns)) + "\n"
    heads = zip(trajectory.time, trajectory.step, trajectory.target, trajectory.payload, strict=True)
    for (time, step, target, payload), row in zip(heads, values.tolist(), strict=True):
        name = target_names[target] if target >= 0 else ""
        out.write(f"{time:.{DIGITS}g},{step},{name},{payload:.{DIGITS}g}," + line % tuple(row))
    return out.getvalue()
