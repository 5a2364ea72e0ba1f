"""Bases so low that the motor of the first joint is inside the ground."""

from collections.abc import Iterator
from itertools import product

from armwright.problem.checks.finding import PROVEN, Finding
from armwright.problem.checks.inside_obstacles import required_clearance
from armwright.problem.checks.reach import ROUNDING, base_box
from armwright.problem.problem import Problem
from armwright.robot.motor_body import MotorBody, placed_body
from armwright.spaces.joint_modules import DIRECTIONS, MODULES
from armwright.spaces.parameters import CategoricalParameter
from armwright.tasks.obstacles import Ground


def check_base_motor(problem: Problem) -> Iterator[Finding]:
    """Find a ground that the motor of the first joint of every floor-mounted arm is in.

    This motor is at rest and may touch the ground, but not be inside.
    """
    grounds = [obstacle for obstacle in problem.task.obstacles if isinstance(obstacle, Ground)]
    space = problem.space
    if not (grounds and space.has_motor_bodies and space.mount == ("floor",)) or required_clearance(problem) < 0.0:
        return
    bodies = _first_bodies(problem)
    highest, ground = float(base_box(space)[1][2]), max(grounds, key=lambda one: one.z)
    if not bodies:
        return
    name, depth = min(((name, body.size[2] / 2 - body.centre[2]) for name, body in bodies), key=lambda one: one[1])
    needed = ground.z + depth
    if highest + ROUNDING * (1.0 + abs(highest)) < needed:
        yield Finding(
            f"origin_z: the base is at most at {highest:g} m, but the motor of the first joint reaches at least "
            f"{1e3 * depth:.3g} mm below it ({name}), into an obstacle: {ground.describe()}; allow bases from "
            f"{needed:.3g} m up, or leave the motors out with motor_bodies: false",
            PROVEN,
        )


def _first_bodies(problem: Problem) -> list[tuple[str, MotorBody]]:
    """Return the bodies that the actuator of the first joint may have, by its name; none if that joint may be fixed."""
    space = problem.space
    choices = {p.name: p.choices for p in space.parameters if isinstance(p, CategoricalParameter)}
    modules = [MODULES[letter] for letter in space.joint_types if letter in choices["joint_1"]]
    names = choices.get("motor_1", tuple(record.name for record in space.actuators))
    if not all(module.is_actuated for module in modules):
        return []
    return [
        (actuator.name, placed_body(actuator.shape, module.joints[0][1], DIRECTIONS["+z"]))
        for actuator, module in product(space.arm_actuators, modules)
        if actuator.name in names and actuator.shape is not None
    ]
