"""Bases so low that the motor of the first joint is inside the ground."""

from collections.abc import Iterator

from armwright.problem.checks.bounds import combinations
from armwright.problem.checks.finding import PROVEN, Finding
from armwright.problem.checks.inside_obstacles import required_clearance
from armwright.problem.checks.reach import ROUNDING, base_box
from armwright.problem.problem import Problem
from armwright.spaces.arm_builder import build_arm
from armwright.tasks.obstacles import Ground


def check_base_motor(problem: Problem) -> Iterator[Finding]:
    """Find a ground that the first motor of every floor-mounted arm is inside; being at rest, it may touch a ground."""
    grounds = [obstacle for obstacle in problem.task.obstacles if isinstance(obstacle, Ground)]
    space = problem.space
    if not (grounds and space.has_motor_bodies and space.mount == ("floor",)) or required_clearance(problem) < 0.0:
        return
    rows = combinations(space, ("joint_1", "motor_1"))
    joints = [build_arm(space, row[None]).joints[0] for row in rows]
    depths = [
        (joint.body.size[2] / 2 - joint.body.centre[2], joint.actuator.name)
        for joint in joints
        if joint.body is not None and joint.actuator is not None
    ]
    if len(depths) < len(joints):  # an arm whose first joint is fixed has no motor there
        return
    depth, name = min(depths)
    highest, ground = float(base_box(space)[1][2]), max(grounds, key=lambda one: one.z)
    needed = ground.z + depth
    if highest + ROUNDING * (1.0 + abs(highest)) < needed:
        yield Finding(
            f"origin_z: the base is at most at {highest:g} m, but the motor of the first joint reaches at least "
            f"{1e3 * depth:.3g} mm below it ({name}), into an obstacle: {ground.describe()}; allow bases from "
            f"{needed:.3g} m up, or leave the motors out with motor_bodies: false",
            PROVEN,
        )
