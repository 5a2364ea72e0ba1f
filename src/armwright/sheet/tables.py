"""The title, sentences and tables of a data sheet as text."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from armwright.problem.facts import ASKED, PAYLOAD_AT_FULL_REACH, VOLTAGE
from armwright.sheet.record import NOT_STATED, DataSheet, JointLine
from armwright.tasks.moments import MAX_MASS
from armwright.text import significant

AXIS_NAMES = {"x": "roll (x)", "y": "pitch (y)", "z": "yaw (z)"}
SHOWN_UNITS = {"m": (1e3, " mm"), "rad": (math.degrees(1.0), "°")}  # of objectives


@dataclass(frozen=True)
class Table:
    """A table of a data sheet."""

    title: str  # its title
    header: tuple[str, ...]  # names of the columns, with units; empty for pairs of a name and a value
    rows: tuple[tuple[str, ...], ...]  # the cells
    left: tuple[int, ...] = (0,)  # indices of the columns that are aligned at the left; the others have numbers
    note: str = ""  # A line below; why there are no rows, if there are none


def number(value: float | None, factor: float = 1.0, missing: str = NOT_STATED) -> str:
    """Return a value in other units, with three significant digits and no exponent; never more than 3 decimals."""
    return missing if value is None else significant(factor * value)


def money(value: float | None, missing: str = NOT_STATED) -> str:
    """Return a price with cents [USD]."""
    return missing if value is None else f"{value:,.2f}"


def verdict_of(sheet: DataSheet) -> str:
    """Return role, verdict and survival in one sentence; empty for an existing arm."""
    role = f"recommended ({sheet.role.replace('_', ' ')})" if sheet.role else ""
    broken = f"infeasible: {', '.join(sheet.violated)}" if sheet.violated else ""
    text = "; ".join(filter(None, (broken, role, sheet.status and f"simulation: {sheet.status}", sheet.survival)))
    return f"{text[0].upper()}{text[1:]}." if text else ""


def key_figures(sheet: DataSheet) -> Table:
    """Return what an engineer asks first."""
    asked = {name: sheet.facts[name] for name in (*ASKED, VOLTAGE)}
    held = asked[PAYLOAD_AT_FULL_REACH].value
    note = " (the actuators do not hold the arm itself)" if held == 0.0 else ""
    rows = [
        ("Base", NOT_STATED if sheet.base_position is None else _base(sheet.base_position, sheet.base_yaw or 0.0)),
        ("Payload of the task", "none" if sheet.payload is None else f"{significant(sheet.payload)} kg"),
        *((fact.label, fact.text + note * (name == PAYLOAD_AT_FULL_REACH)) for name, fact in asked.items()),
    ]
    others = ((name, one) for name, one in sheet.objectives.items() if name not in asked)
    rows += [("Objective " + name, _objective(value, unit)) for name, (value, unit) in others]
    return Table("Key figures", (), tuple(rows), (0, 1))


def joint_table(sheet: DataSheet) -> Table:
    """Return ranges and drives of the joints; angles in degrees, slides in millimetres."""
    header = ("#", "joint", "drive", "range", "used", "unused", "torque", "peak", "peak use", "speed use", "thermal",
              "tilting", "bearing use")  # fmt: skip
    rows = tuple(_joint_row(sheet, joint) for joint in sheet.joints)
    notes = ["Range in ° or mm, torque in N m or N (prismatic), tilting moment in N m; unused: below and above."]
    idle = [str(joint.number) for joint in sheet.joints if joint.used and joint.used[1] - joint.used[0] < 1e-3]
    if idle:
        notes.append(f"Joint {', '.join(idle)} does not move in this task.")
    reasons = {
        sheet.facts[name].reason: sheet.facts[name].label for name in ("thermal_utilisation", "torque_utilisation")
    }
    notes += [f"{label}: {NOT_STATED}, {reason}." for reason, label in reasons.items() if reason]
    return Table("Joints and drives", header, rows, (1, 2), " ".join(notes))


def link_table(sheet: DataSheet) -> Table:
    """Return what to cut."""
    rows = tuple(
        (
            str(link.number),
            f"{1e3 * link.length:.1f}",
            NOT_STATED
            if link.outer_diameter is None
            else f"{1e3 * link.outer_diameter:g} x {1e3 * (link.wall or 0.0):g}",
            number(link.mass, 1e3),
        )
        for link in sheet.links
        if link.length > 0.0
    )
    return Table("Links", ("#", "length [mm]", "tube [mm]", "mass [g]"), rows, ())


def mass_table(sheet: DataSheet) -> Table:
    """Return the mass by parts, with the sum."""
    whole = sum(line.mass for line in sheet.masses)
    rows = [(line.part, number(line.mass, 1e3), f"{line.mass / whole:.0%}") for line in sheet.masses]
    rows += [("together", number(whole, 1e3), "100%")] if rows else []
    return Table("Mass", ("part", "mass [g]", "share"), tuple(rows), (0,), sheet.facts["mass"].reason)


def parts_table(sheet: DataSheet) -> Table:
    """Return the parts list."""
    rows = tuple(
        (str(part.count), part.part, money(part.unit_price, missing="–"), money(part.price), part.detail)
        for part in sheet.parts
    )
    notes = [f"Neither mass nor price include {sheet.not_modelled}."] if sheet.not_modelled else []
    if not rows:
        notes.append("A URDF names no parts.")
    return Table("Parts", ("n", "part", "each [USD]", "price [USD]", "detail"), rows, (1, 4), " ".join(notes))


def reach_table(sheet: DataSheet) -> Table:
    """Return payload and errors over the reach."""
    rows = tuple(
        (
            f"{line.fraction:.0%}",
            number(line.distance, 1e3),
            "any" if line.payload is not None and line.payload >= MAX_MASS else number(line.payload, missing="–"),
            number(line.deflection, 1e3, missing="–"),
            number(line.backlash_error, 1e3, missing="–"),
        )
        for line in sheet.over_reach
    )
    header = ("reach", "distance [mm]", "payload [kg]", "deflection [mm]", "backlash [mm]")
    return Table("Over the reach", header, rows, (), "–: no posture was found there, or not stated.")


def _base(position: Sequence[float], yaw: float) -> str:
    """Return where the base is: the first joint of a design, the base link of an existing arm."""
    turned = f", turned by {math.degrees(yaw):.1f}°" if yaw else ""
    return f"at ({', '.join(f'{1e3 * value + 0.0:.1f}' for value in position)}) mm{turned}"


def _objective(value: float | None, unit: str) -> str:
    """Return an objective, a length in millimetres and an angle in degrees."""
    factor, shown = SHOWN_UNITS.get(unit, (1.0, f" {unit}"))
    return number(value) if value is None else f"{number(value, factor)}{shown}".rstrip()


def _joint_row(sheet: DataSheet, joint: JointLine) -> tuple[str, ...]:
    factor, digits = (1e3, 1) if joint.kind == "prismatic" else (math.degrees(1.0), 0)

    def pair(values: tuple[float, float] | None, between: str) -> str:
        shown = [f"{round(factor * value, digits) + 0.0:.{digits}f}" for value in values or ()]
        return between.join(shown) or "–"

    def share(value: float | None) -> str:
        return "–" if value is None else f"{value:.0%}"

    axis = f"slide ({joint.axis})" if joint.kind == "prismatic" else AXIS_NAMES.get(joint.axis, f"about {joint.axis}")
    return (
        str(joint.number),
        axis if joint.name == f"joint_{joint.number}" else f"{joint.name}, {axis}",
        NOT_STATED if not joint.actuator else "URDF" if joint.actuator == joint.name else joint.actuator,
        pair((joint.lower, joint.upper), " to "),
        pair(joint.used, " to "),
        pair(joint.unused, " | "),
        number(joint.torque, missing="–"),
        number(joint.peak_torque, missing="–"),
        *map(share, (joint.peak_utilisation, joint.speed_utilisation, joint.thermal_utilisation)),
        number(joint.tilting_moment, missing="–"),
        share(joint.bearing_utilisation),
    )
