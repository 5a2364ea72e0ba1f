"""What motor bodies cost: full cycles evaluated a second on one core, with and without them.

Random arms of six joints along the cycle of `cycles.py`, with boxes (XM540-W270) and cylinders (AK60-6) as motors.

    python benchmarks/motor_bodies.py
"""

import statistics
from collections.abc import Callable

from cycles import SPACE, TASK
from one_core import on_one_core, print_rates, rates_in_turn

from armwright.problem.problem import Problem
from armwright.spaces.design_space import DesignSpace

N, ROUNDS = 256, 5
MOTORS = ("XM540-W270", "AK60-6")


def main() -> None:
    matrix = SPACE.matrix(SPACE.sample(N, seed=0))
    work: dict[str, Callable[[], object]] = {}
    for motor in MOTORS:
        for has_bodies, name in ((False, "without"), (True, "with")):
            keys = {"actuators": [motor], "motor_bodies": has_bodies}
            problem = Problem(TASK, DesignSpace.model_validate(SPACE.model_dump() | keys))
            work[f"{motor} {name} bodies"] = lambda problem=problem: problem.evaluate_matrix(matrix)
    rates = rates_in_turn(work, N, ROUNDS)
    print(f"Cycles a second on one core; median of {ROUNDS} (least, most)")
    print_rates(rates)
    for motor in MOTORS:
        pairs = zip(rates[f"{motor} with bodies"], rates[f"{motor} without bodies"], strict=True)
        print(f"  {motor}: with bodies, of without {statistics.median(a / b for a, b in pairs):.2f}")


if __name__ == "__main__":
    on_one_core(__file__, main)
