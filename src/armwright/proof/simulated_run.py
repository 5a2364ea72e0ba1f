"""Simulation of designs of a run."""

import time
from dataclasses import dataclass

from armwright.exceptions import SettingsError, UnknownQuantityError
from armwright.kinematics.cycle.trajectory import Trajectory
from armwright.problem.evaluation import Evaluation
from armwright.problem.problem import Problem
from armwright.proof.cycle_export import modelled
from armwright.proof.simulation import SimulatedDesign, simulate_design
from armwright.robot.arm import Arm
from armwright.runs.history import History


@dataclass(frozen=True)
class SimulatedMember:
    """A simulated design of a history."""

    result: SimulatedDesign
    trajectory: Trajectory  # how it should move
    files: dict[str, str]  # content of its model and trajectory, by name


class Simulator:
    """Simulate designs of a history, each at most once; SettingsError if the task has no cycle."""

    def __init__(self, history: History) -> None:
        if history.problem.task.cycle is None:
            raise SettingsError(f"task {history.problem.task.name} has no cycle to simulate; try cycle: in_order")
        self.history = history
        self.members: dict[int, SimulatedMember] = {}
        self.seconds = 0.0  # that the latest simulation took [s]

    def __call__(self, number: int) -> SimulatedMember:
        """Return a simulated design; SettingsError if a duration of its steps is not known."""
        if number not in self.members:
            started = time.perf_counter()
            arm, evaluation = self.history.member(number).arm, self.history.evaluation([number])
            self.members[number] = simulate_arm(self.history.problem, arm, evaluation, 0, number)
            self.seconds = time.perf_counter() - started
        return self.members[number]


def simulate_arm(problem: Problem, arm: Arm, evaluation: Evaluation, row: int, number: int) -> SimulatedMember:
    """Simulate the arm of a design, row `row` of an evaluation; SettingsError if a duration of a step is unknown."""
    names = problem.task.target_names
    try:
        model = modelled(arm, names, evaluation, row, f"{problem.task.name}-{number}")
    except UnknownQuantityError as fault:
        raise SettingsError(
            f"task {problem.task.name} leaves durations of steps open, and the arms have no actuators with known "
            "speeds; try cycle: {time: 1.5, ...}"
        ) from fault
    result = simulate_design(number, model.mjcf, model.trajectory, names)
    return SimulatedMember(result, model.trajectory, model.files(names))
