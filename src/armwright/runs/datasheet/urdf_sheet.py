"""The data sheet of an arm that exists, from its URDF."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from armwright.exceptions import SettingsError, did_you_mean
from armwright.robot.actuators import ActuatorRecord, named_actuator, value_of
from armwright.robot.arm import Arm, Joint
from armwright.robot.urdf_reader import UrdfArm
from armwright.runs.assumptions import describe_assumed
from armwright.runs.datasheet.joint_lines import joint_lines
from armwright.runs.datasheet.over_reach import drawing_of, link_line, reach_lines
from armwright.runs.datasheet.parts import price_source
from armwright.runs.datasheet.sheet import DataSheet, MassLine, Part, ReachLine

SAFETY_FACTOR = 1.5  # of torques, as that of designs by default
NO_TASK = "an arm without a task"
ENTERING = ("stall_torque", "peak_torque", "backlash", "joint_stiffness")  # values of actuators that a sheet shows


def read_actuators(text: str, joints: Sequence[str]) -> dict[str, ActuatorRecord]:
    """Parse `shoulder=XM540-W270,elbow=XM430-W350` into actuators of the catalogue by joint.

    Args:
        text: Names of joints, or their numbers from 1, with names of actuators.
        joints: The names of the moving joints.

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


def urdf_sheet(described: UrdfArm, actuators: Mapping[str, ActuatorRecord] | None = None) -> DataSheet:
    """Return the data sheet of an existing arm.

    Args:
        described: The arm.
        actuators: Actuators of joints by name, in place of the effort that the URDF states. Their masses are taken to
            be included in those of the links.
    """
    actuators = actuators or {}
    arm = replace(_driven(described, actuators), safety_factor=SAFETY_FACTOR)
    over_reach = reach_lines(arm, 0.0)
    return DataSheet(
        name=described.name,
        design=None,
        joint_letters="",
        reach=over_reach[-1].distance,
        mass=arm.mass,
        payload_at_full_reach=over_reach[-1].payload,
        joints=joint_lines(arm, names=described.joints),
        links=tuple(link_line(arm, n) for n in range(1, len(arm.links) + 1)),
        masses=_masses(arm),
        parts=_parts(actuators),
        over_reach=over_reach,
        drawing=drawing_of(arm, np.zeros((0, 3))),
        missing=_missing(arm, over_reach),
        assumptions=_assumptions(described, actuators),
        not_modelled="",
    )


def _driven(described: UrdfArm, actuators: Mapping[str, ActuatorRecord]) -> Arm:
    """Return the arm with the named actuators; SettingsError for a slide, whose gearing a URDF does not state."""

    def driven(name: str, joint: Joint) -> Joint:
        record = actuators.get(name)
        if record is None:
            return joint
        if joint.kind == "prismatic":
            raise SettingsError(
                f'--actuators: expected a revolute joint, got the prismatic joint "{name}"; leave it out'
            )
        return replace(joint, actuator=record.actuator())

    pairs = zip(described.joints, described.arm.joints, strict=True)
    return replace(described.arm, joints=tuple(driven(name, joint) for name, joint in pairs))


def _masses(arm: Arm) -> tuple[MassLine, ...]:
    """Return the parts of the mass; empty if the URDF states none."""
    lines = [MassLine("base", arm.base_mass)]
    lines += [MassLine(f"link {n}", link.mass) for n, link in enumerate(arm.links, start=1)]
    return tuple(line for line in lines if line.mass > 0.0)


def _parts(actuators: Mapping[str, ActuatorRecord]) -> tuple[Part, ...]:
    records = list(actuators.values())
    return tuple(
        Part(
            part=record.name,
            count=records.count(record),
            unit_price=record.price,
            price=None if record.price is None else records.count(record) * record.price,
            detail=f"{record.maker} {record.kind}".strip(),
            source=record.source,
            price_source=price_source(record),
        )
        for record in dict.fromkeys(records)
    )


def _missing(arm: Arm, over_reach: Sequence[ReachLine]) -> dict[str, str]:
    """Return why values are not stated."""
    of_task = ("payload", "position_error", "backlash_error", "cycle_time", "supply", "used", "utilisation")
    found: dict[str, str] = dict.fromkeys((*of_task, "thermal_utilisation"), NO_TASK)
    found["price"] = "a URDF states no price"
    found["deflection"] = "a URDF states no stiffness of links"
    found["sensitivities"] = "an existing arm has no design space"
    if not arm.mass:
        found["mass"] = "no link of the URDF states a mass"
    if over_reach[-1].payload is None:
        found["payload_at_full_reach"] = "not every joint states an effort"
    return found


def _assumptions(described: UrdfArm, actuators: Mapping[str, ActuatorRecord]) -> dict[str, str]:
    """Return what the values assume, by what they are about."""
    found = {
        "reach": "horizontal distance of the tip from the first joint; the outlines show the farthest point found in "
        "each of 72 directions around the base",
        "over the reach": "the least favourable of all postures found, in directions in which the arm reaches nearly "
        "as far as in any; the payload is a point at the tip",
        "payload": f"held at rest with a safety factor of {SAFETY_FACTOR:g}; torques are the efforts of the URDF"
        + (
            ", or the peaks of the named actuators, whose masses are included in those of the links"
            if actuators
            else ""
        ),
    }
    if described.notes:
        found["URDF"] = "; ".join(described.notes)
    assumed = {record.name: _assumed(record) for record in actuators.values()}
    if any(assumed.values()):
        shown = {name: values for name, values in assumed.items() if values}
        found["actuators"] = f"defaults of their kind or estimates: {describe_assumed(shown)}"
    return found


def _assumed(record: ActuatorRecord) -> dict[str, float]:
    completed = record.completed()
    values = {name: value_of(completed, name) for name in record.assumed if name in ENTERING}
    return {name: value for name, value in values.items() if value is not None}
