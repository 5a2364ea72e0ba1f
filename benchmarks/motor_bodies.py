"""What solid bodies cost: full cycles evaluated a second on one core, with and without motor bodies and a column.

Random arms of six joints along the cycle of `cycles.py`, with boxes (XM540-W270) and cylinders (AK60-6) as motors, and
with a column of half a metre below their bases.

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
COLUMN = {"foot": -0.5}
BODIES = {
    "no bodies": {"motor_bodies": False},
    "motors": {"motor_bodies": True},
    "column": {"motor_bodies": False, "column": COLUMN},
    "motors and column": {"motor_bodies": True, "column": COLUMN},
}
RATIOS = (("motors", "no bodies"), ("column", "no bodies"), ("motors and column", "motors"))


def main() -> None:
    matrix = SPACE.matrix(SPACE.sample(N, seed=0))
    work: dict[str, Callable[[], object]] = {}
    for motor in MOTORS:
        for name, bodies in BODIES.items():
            keys = {"actuators": [motor], **bodies}
            problem = Problem(TASK, DesignSpace.model_validate(SPACE.model_dump() | keys))
            work[f"{motor}: {name}"] = lambda problem=problem: problem.evaluate_matrix(matrix)
    rates = rates_in_turn(work, N, ROUNDS)
    print(f"Cycles a second on one core; median of {ROUNDS} (least, most)")
    print_rates(rates)
    for motor in MOTORS:
        for name, other in RATIOS:
            pairs = zip(rates[f"{motor}: {name}"], rates[f"{motor}: {other}"], strict=True)
            print(f"  {motor}: {name}, of {other} {statistics.median(a / b for a, b in pairs):.2f}")


if __name__ == "__main__":
    on_one_core(__file__, main)
