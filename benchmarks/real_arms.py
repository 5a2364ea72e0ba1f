"""What a real design problem costs: designs a second on one core, with axis targets, capsules and motors.

Six joints, eight targets where the tool's axis counts, links against each other and three obstacles, an actuator for
each joint; position, orientation, collision and torque use are asked. Beside it the same arms in the paper's problem.

    python benchmarks/real_arms.py
"""

from one_core import on_one_core, print_rates, rates_in_turn

from armwright.problem.problem import Problem
from armwright.spaces.design_space import DesignSpace
from armwright.tasks.catalogue import load_task
from armwright.tasks.task import Task

N, ROUNDS = 4000, 7
REAL = Task.model_validate(
    {
        "name": "real",
        "targets": [
            {"position": list(point), "axis": [0.0, 0.0, -1.0]}
            for point in load_task("target-1").target_positions.tolist()
        ],
        "payload": 0.2,
        "obstacles": [
            {"kind": "ground", "z": -0.6},
            {"kind": "box", "center": [0.5, 0.0, 0.2], "size": [0.3, 0.7, 0.02], "yaw": 0.3},
            {"kind": "cylinder", "center": [0.3, 0.3, 0.0], "radius": 0.03, "height": 1.2},
        ],
        "objectives": ["position_error", "orientation_error", "collision", "torque_utilisation"],
    }
)
SPACE = DesignSpace.model_validate(
    {
        "name": "real", "joints": 6, "actuators": ["XL430-W250", "XM430-W350", "XM540-W270"], "safety_factor": 1.0,
        "link_section": {"tubes": [[0.03, 0.002]], "material": "aluminium"},
    }
)  # fmt: skip


def main() -> None:
    matrix = SPACE.matrix(SPACE.sample(N, seed=0))
    problems = {
        "the paper's objectives, points alone": Problem(load_task("target-1"), SPACE),
        "axes, capsules, obstacles and motors": Problem(REAL, SPACE),
    }
    work = {name: lambda problem=problem: problem.evaluate_matrix(matrix) for name, problem in problems.items()}
    rates = rates_in_turn(work, N, ROUNDS)
    print(f"Designs/s on one core, D = 6, 8 targets; median of {ROUNDS} (least, most)")
    print_rates(rates)


if __name__ == "__main__":
    on_one_core(__file__, main)
