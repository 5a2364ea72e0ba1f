"""The data sheet of an arm that exists, from its URDF."""

from dataclasses import replace
from typing import Any

import numpy as np

from armwright.exceptions import SettingsError
from armwright.existing.base_placement import Placement
from armwright.existing.existing_arm import ExistingArm
from armwright.kinematics.arms.arm_arrays import stack_arms
from armwright.problem.facts import VOLTAGE, Fact, Facts, fact_of, mass_fact, reach_facts
from armwright.problem.objectives import QUANTITIES
from armwright.robot.arm import Arm
from armwright.robot.urdf_reader import UrdfArm
from armwright.sheet.arm_lines import ASSUMED, arm_lines
from armwright.sheet.joint_lines import joint_lines
from armwright.sheet.record import DataSheet, MassLine

SAFETY_FACTOR = 1.5  # of torques, as that of designs by default
NO_TASK = "an arm without a task"
NO_PRICE = "a URDF states no price; try --price"


def urdf_sheet(subject: UrdfArm | Placement, price: float | None = None) -> DataSheet:
    """Return the data sheet of an existing arm, as read or in its place on a task.

    The price [USD] is as stated.

    Raises:
        SettingsError: If the price is not a finite number of at least 0.
    """
    if price is not None and not 0.0 <= price < np.inf:
        raise SettingsError(f"price: expected a finite number of at least 0 USD, got {price:g}")
    described, place = (subject, None) if isinstance(subject, UrdfArm) else (subject.described, subject)
    arm = described.arm
    existing, payload, targets = None, 0.0, np.zeros((0, 3))
    if place is None:
        arm = replace(arm, safety_factor=SAFETY_FACTOR)
    else:
        existing = ExistingArm(place.problem, place.problem.physics(stack_arms([arm])), price)
        payload, targets = float(place.problem.task.payloads.max()), existing.evaluation.targets
    lines = arm_lines(arm, payload, targets)
    masses = [None if link.without_mass else link.total_mass for link in arm.links]
    lines["links"] = tuple(replace(line, mass=masses[line.number - 1]) for line in lines["links"])
    assumptions = _assumptions(described, arm.safety_factor, place)
    if existing is not None and existing.undecided:
        assumptions["constraints"] = f"unknown whether it meets {', '.join(existing.undecided)}"
    if price is not None:
        assumptions["price"] = "as stated by the user"
    return DataSheet(
        name=described.name if place is None else f"{described.name} on {place.problem.task.name}",
        design=None,
        joint_letters="",
        facts={**_facts(arm, existing, price), **reach_facts(arm, lines["over_reach"][-1])},
        joints=tuple(joint_lines(arm, existing and existing.evaluation, described.joints)),
        masses=_masses(arm),
        assumptions=assumptions,
        not_modelled="",
        **lines,
        **({} if existing is None else _on_task(existing)),
        base_position=None if place is None else place.mounting.position,
        base_yaw=None if place is None else place.mounting.yaw,
    )


def _on_task(existing: ExistingArm) -> dict[str, Any]:
    """Return what an arm does on its task, by field of a data sheet."""
    objectives = zip(existing.problem.objectives, existing.objectives, strict=True)
    return {
        "violated": existing.violated,
        "objectives": {objective.name: (value, objective.unit) for objective, value in objectives},
        "payload": float(existing.problem.task.payloads.max()) or None,
    }


def _masses(arm: Arm) -> tuple[MassLine, ...]:
    """Return the parts of the mass; none if it is not known."""
    if arm.no_mass:
        return ()
    lines = [MassLine("base", arm.base_mass)]
    lines += [MassLine(f"link {n}", link.total_mass) for n, link in enumerate(arm.links, start=1)]
    lines.append(MassLine("tool", arm.tool.mass))
    return tuple(line for line in lines if line.mass > 0.0)


def _facts(arm: Arm, existing: ExistingArm | None, price: float | None) -> Facts:
    """Return what is known of an arm; without a task, its mass and its price."""
    if existing is not None:
        return existing.facts(arm)
    facts = {name: fact_of(quantity, None, NO_TASK) for name, quantity in QUANTITIES.items()}
    facts[VOLTAGE] = Fact("Supply voltage", "V", "The voltage of all actuators.", None, NO_TASK)
    facts["price"] = fact_of(QUANTITIES["price"], price, "" if price is not None else NO_PRICE)
    return facts | {"mass": mass_fact(arm)}


def _assumptions(described: UrdfArm, safety_factor: float, place: Placement | None) -> dict[str, str]:
    """Return what the values assume, by what they are about."""
    found = {} if place is None else {"place": place.description}
    found |= {
        "reach": ASSUMED["reach"],
        "over the reach": f"{ASSUMED['over the reach']}; the payload is a point at the tip",
        "torques": f"with a safety factor of {safety_factor:g}; peaks are the efforts of the URDF",
    }
    if described.notes:
        found["URDF"] = "; ".join(described.notes)
    return found
