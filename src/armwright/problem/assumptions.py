"""Assumed values of actuators that enter the results of designs: estimates and defaults (`ActuatorRecord.assumed`)."""

from collections.abc import Iterable, Mapping

from armwright.problem.problem import Problem
from armwright.robot.actuators import UNITS, value_of
from armwright.robot.arm import Arm
from armwright.text import rounded

STATIC = ("mass", "stall_torque", "peak_torque")
ALONG_CYCLE = (
    *STATIC, "voltage", "rated_torque", "speed", "corner_speed", "rotor_inertia", "coulomb_friction",
    "viscous_friction", "load_friction", "position_gain", "current",
)  # fmt: skip
YIELDING = ("joint_stiffness", "backlash", "bearing_offset")  # enter only quantities that need them

Assumed = Mapping[str, Mapping[str, float]]  # assumed values by actuator and name, in the units of UNITS


def assumed_values(problem: Problem, arms: Iterable[Arm] | None = None, also: Iterable[str] = ()) -> Assumed:
    """Return the assumed values that enter the results; actuators without any are left out.

    Only actuators of `arms` count, by default all of the space. `also` names values that enter besides those that
    objectives and constraints depend on.
    """
    records = problem.space.actuators
    if arms is not None:
        used = {joint.actuator.name for arm in arms for joint in arm.joints if joint.actuator is not None}
        records = [record for record in records if record.name in used]
    entering = {*(STATIC if problem.task.cycle is None else ALONG_CYCLE), *also}
    entering |= {*YIELDING} & {rating for quantity in problem.quantities for rating in quantity.ratings}
    entering |= {"bracket_mass"} if problem.space.bracket_mass is None else set()
    if problem.space.has_motor_bodies:
        entering.add("shaft_offset")
    found: dict[str, dict[str, float]] = {}
    for record in records:
        completed = record.completed()
        for name in record.assumed:
            if name in entering and (value := value_of(completed, name)) is not None:
                found.setdefault(record.name, {})[name] = value
    return found


def count_assumed(assumed: Assumed) -> str:
    """Return how many values of each actuator are assumed: `7 of XM430-W350, 6 of XM540-W270`."""
    return ", ".join(f"{len(values)} of {name}" for name, values in assumed.items())


def describe_assumed(assumed: Assumed) -> str:
    """Return all assumed values on one line, with units."""
    return "; ".join(
        f"{name}: "
        + ", ".join(f"{key.replace('_', ' ')} {rounded(value)} {UNITS[key]}".rstrip() for key, value in values.items())
        for name, values in assumed.items()
    )
