"""The data sheet of an arm that exists, from its URDF."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from armwright.exceptions import SettingsError, did_you_mean
from armwright.existing.existing_arm import ExistingArm
from armwright.kinematics.arms.arm_arrays import stack_arms
from armwright.problem.assumptions import ALONG_CYCLE, assumed_of, describe_assumed
from armwright.problem.facts import VOLTAGE, Fact, Facts, fact_of, reach_facts
from armwright.problem.objectives import QUANTITIES
from armwright.problem.problem import Problem
from armwright.robot.actuators import ActuatorRecord, named_actuator
from armwright.robot.arm import Arm, Joint
from armwright.robot.mounting import Mounting
from armwright.robot.urdf_reader import UrdfArm
from armwright.sheet.arm_lines import ASSUMED, arm_lines
from armwright.sheet.joint_lines import joint_lines
from armwright.sheet.parts import actuator_parts
from armwright.sheet.record import DataSheet, JointLine, MassLine

SAFETY_FACTOR = 1.5  # of torques, as that of designs by default
NO_TASK = "an arm without a task"
NO_PRICE = "a URDF states no price; try --price"
ENTERING = ("stall_torque", "peak_torque", "backlash")  # values of actuators that a sheet without a task shows


def read_actuators(text: str, joints: Sequence[str]) -> dict[str, ActuatorRecord]:
    """Parse `shoulder=XM540-W270,elbow=XM430-W350` into actuators of the catalogue by joint.

    Joints are given by name, or by number from 1.

    Raises:
        SettingsError: A part is no pair, or there is no such joint.
        SpaceError: The catalogue has no such actuator.
    """
    found: dict[str, ActuatorRecord] = {}
    for part in text.split(","):
        joint, equals, name = (word.strip() for word in part.partition("="))
        if not (joint and equals and name):
            raise SettingsError(
                f'--actuators "{part.strip()}": expected JOINT=NAME; try {joints[0]}=XM430-W350, several with commas'
            )
        if joint.isdecimal() and 1 <= int(joint) <= len(joints):
            joint = joints[int(joint) - 1]
        if joint not in joints:
            raise SettingsError(
                f'--actuators: unknown joint "{joint}".{did_you_mean(joint, joints)} Joints: {", ".join(joints)}'
            )
        if joint in found:
            raise SettingsError(f'--actuators: expected one actuator for the joint "{joint}", got two')
        found[joint] = named_actuator(name)
    return found


@dataclass(frozen=True)
class Job:
    """The task of an existing arm."""

    problem: Problem  # the task, its objectives and constraints
    mounting: Mounting  # where the base link stands
    place: str  # the same in words, and why there


def urdf_sheet(
    described: UrdfArm,
    actuators: Mapping[str, ActuatorRecord] | None = None,
    job: Job | None = None,
    price: float | None = None,
) -> DataSheet:
    """Return the data sheet of an existing arm; with a job, in its place and with the tool of the task.

    The actuators are those that `driven` has put at its joints, by name. The price [USD] is the stated one, in place of
    that of its parts.

    Raises:
        SettingsError: If the price is not a finite number of at least 0.
    """
    if price is not None and not 0.0 <= price < np.inf:
        raise SettingsError(f"price: expected a finite number of at least 0 USD, got {price:g}")
    actuators, arm = actuators or {}, described.arm
    existing, payload, targets = None, 0.0, np.zeros((0, 3))
    if job is None:
        arm = replace(arm, safety_factor=SAFETY_FACTOR)
    else:
        existing = ExistingArm(job.problem, job.problem.physics(stack_arms([arm])), price)
        payload, targets = float(job.problem.task.payloads.max()), existing.evaluation.targets
    lines = arm_lines(arm, payload, targets, described.values_in_arm(np.zeros(len(arm.joints))).tolist())
    assumptions = _assumptions(described, actuators, arm.safety_factor, job)
    if existing is not None and existing.undecided:
        assumptions["constraints"] = f"unknown whether it meets {', '.join(existing.undecided)}"
    if price is not None:
        assumptions["price"] = "as stated by the user"
    return DataSheet(
        name=described.name if job is None else f"{described.name} on {job.problem.task.name}",
        design=None,
        joint_letters="",
        facts={**_facts(arm, existing, price), **reach_facts(lines["over_reach"][-1])},
        joints=_joints(described, existing),
        masses=_masses(arm),
        parts=tuple(actuator_parts(list(actuators.values()))),
        assumptions=assumptions,
        not_modelled="",
        **lines,
        **({} if existing is None else _on_task(existing)),
        base_position=None if job is None else job.mounting.position,
        base_yaw=None if job is None else job.mounting.yaw,
    )


def _on_task(existing: ExistingArm) -> dict[str, Any]:
    """Return what an arm does on its task, by field of a data sheet."""
    objectives = zip(existing.problem.objectives, existing.objectives, strict=True)
    return {
        "violated": existing.violated,
        "objectives": {objective.name: (value, objective.unit) for objective, value in objectives},
        "payload": float(existing.problem.task.payloads.max()) or None,
    }


def _joints(described: UrdfArm, existing: ExistingArm | None) -> tuple[JointLine, ...]:
    """Return the lines of the joints, with values as the URDF counts them."""
    evaluation = None if existing is None else existing.evaluation
    lines = joint_lines(described.arm, evaluation, described.joints)
    return tuple(map(_in_urdf, lines, described.signs, described.zeros))


def _in_urdf(line: JointLine, sign: float, zero: float) -> JointLine:
    """Return the line of a joint whose value q is sign * q + zero in the URDF."""

    def span(low: float, high: float) -> tuple[float, float]:
        first, last = sign * low + zero, sign * high + zero
        return min(first, last), max(first, last)

    lower, upper = span(line.lower, line.upper)
    if line.used is None or line.unused is None:
        return replace(line, lower=lower, upper=upper)
    below, above = line.unused if sign > 0.0 else line.unused[::-1]
    return replace(line, lower=lower, upper=upper, used=span(*line.used), unused=(below, above))


def driven(described: UrdfArm, actuators: Mapping[str, ActuatorRecord]) -> UrdfArm:
    """Return an arm with actuators at joints by name, in place of the efforts that the URDF states.

    Their masses are taken to be included in those of the links.

    Raises:
        SettingsError: If one is at a slide, whose gearing a URDF does not state.
    """

    def with_actuator(name: str, joint: Joint) -> Joint:
        record = actuators.get(name)
        if record is None:
            return joint
        if joint.kind == "prismatic":
            raise SettingsError(
                f'--actuators: expected a revolute joint, got the prismatic joint "{name}"; leave it out'
            )
        return replace(joint, actuator=record.actuator())

    pairs = zip(described.joints, described.arm.joints, strict=True)
    joints = tuple(with_actuator(name, joint) for name, joint in pairs)
    return replace(described, arm=replace(described.arm, joints=joints))


def _masses(arm: Arm) -> tuple[MassLine, ...]:
    """Return the parts of the mass; empty if the URDF states none."""
    lines = [MassLine("base", arm.base_mass)]
    lines += [MassLine(f"link {n}", link.mass) for n, link in enumerate(arm.links, start=1)]
    lines.append(MassLine("tool", arm.tool.mass))
    return tuple(line for line in lines if line.mass > 0.0)


def _facts(arm: Arm, existing: ExistingArm | None, price: float | None) -> Facts:
    """Return what is known of an arm; without a task, its mass and its price."""
    if existing is not None:
        facts = dict(existing.facts(arm))
    else:
        facts = {name: fact_of(quantity, None, NO_TASK) for name, quantity in QUANTITIES.items()}
        facts[VOLTAGE] = Fact("Supply voltage", "V", "The voltage of all actuators.", None, NO_TASK)
        facts["price"] = fact_of(QUANTITIES["price"], price, "" if price is not None else NO_PRICE)
    mass = arm.mass or None
    return facts | {"mass": fact_of(QUANTITIES["mass"], mass, "" if mass else "no link of the URDF states a mass")}


def _assumptions(
    described: UrdfArm, actuators: Mapping[str, ActuatorRecord], safety_factor: float, job: Job | None
) -> dict[str, str]:
    """Return what the values assume, by what they are about."""
    named = ", or those of the named actuators, whose masses are included in those of the links" if actuators else ""
    found = {} if job is None else {"place": job.place}
    found |= {
        "reach": ASSUMED["reach"],
        "over the reach": f"{ASSUMED['over the reach']}; the payload is a point at the tip",
        "torques": f"with a safety factor of {safety_factor:g}; peaks are the efforts of the URDF{named}",
    }
    if described.notes:
        found["URDF"] = "; ".join(described.notes)
    entering = ENTERING if job is None or job.problem.task.cycle is None else (*ENTERING, *ALONG_CYCLE)
    if assumed := assumed_of(actuators.values(), entering):
        found["actuators"] = f"defaults of their kind or estimates: {describe_assumed(assumed)}"
    return found
