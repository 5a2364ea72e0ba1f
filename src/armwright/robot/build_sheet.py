"""The build sheet of an arm: lengths to cut, and limits and loads of each joint."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from armwright.arrays import Array
from armwright.robot.arm import Actuator, Arm, Column

AXIS_NAMES = {"x": "roll (x)", "y": "pitch (y)", "z": "yaw (z)"}


@dataclass(frozen=True)
class SheetRow:
    """A joint and the link after it.

    Attributes:
        length: Length of the link, from joint to joint [m].
        mass: Mass of the link [kg].
        outer_diameter: Outer diameter of its tube [m].
        wall: Wall thickness of its tube [m]; None if unknown.
        lower: Lower limit of the joint [rad] or [m].
        upper: Upper limit of the joint [rad] or [m].
        used: Smallest and largest value at the targets [rad] or [m].
        torque: Largest absolute holding torque at any target [N m], or force of a prismatic joint [N].
        target: Number of that target, counted from 1.
        actuator: Name of the actuator; empty if not chosen.
        utilisation: The torque, times the safety factor, relative to the peak of the actuator; None if unknown.
        price: Price of the actuator [USD]; None if unknown.
    """

    number: int
    kind: str
    axis: str
    length: float
    mass: float
    outer_diameter: float
    wall: float | None
    lower: float
    upper: float
    used: tuple[float, float]
    torque: float
    target: int
    actuator: str
    utilisation: float | None
    price: float | None


def sheet_rows(arm: Arm, q: Array, torques: Array) -> list[SheetRow]:
    """Return a row for each joint; q, torques: (T, J) at the targets."""
    rows: list[SheetRow] = []
    for j, (joint, link) in enumerate(zip(arm.joints, arm.links, strict=True)):
        worst = int(np.argmax(np.abs(torques[:, j])))
        torque, actuator = float(np.abs(torques[worst, j])), joint.actuator
        rows.append(
            SheetRow(
                number=j + 1,
                kind=joint.kind,
                axis=AXIS_NAMES[joint.axis],
                length=link.length,
                mass=link.mass,
                outer_diameter=2.0 * link.radius,
                wall=link.wall,
                lower=joint.lower,
                upper=joint.upper,
                used=(float(q[:, j].min()), float(q[:, j].max())),
                torque=torque,
                target=worst + 1,
                actuator="" if actuator is None else actuator.name,
                utilisation=None if joint.effort is None else arm.safety_factor * torque / joint.effort,
                price=None if actuator is None else actuator.price,
            )
        )
    return rows


def sheet_markdown(title: str, arm: Arm, rows: Sequence[SheetRow], notes: Iterable[str]) -> str:
    """Return the sheet as Markdown."""
    base = ", ".join(f"{1e3 * value:.1f}" for value in arm.base)
    lines = [
        f"# Build sheet: {title}",
        "",
        f"Base, the first joint's place: ({base}) mm. With all joints at 0 the links stand as listed, along their own "
        "axes. Lengths are from joint to joint, the last one to the tip.",
        "",
        "| # | joint | actuator | limits | used at the targets | holds at most | at target | link | tube | mass |",
        "|--:|---|---|---|---|--:|--:|--:|--:|--:|",
    ]
    for row in rows:
        unit, force = ("m", "N") if row.kind == "prismatic" else ("rad", "N m")
        share = "" if row.utilisation is None else f" ({row.utilisation:.0%})"
        motion = [
            f"{row.kind}, {row.axis}",
            row.actuator or "–",
            f"{row.lower:.3f} to {row.upper:.3f} {unit}",
            f"{row.used[0]:.3f} to {row.used[1]:.3f} {unit}",
            f"{row.torque:.4g} {force}{share}",
            str(row.target),
        ]
        if row.kind == "fixed":
            motion = ["fixed", row.actuator or "–", "", "", "", ""]
        cells = [str(row.number), *motion, f"{1e3 * row.length:.1f} mm", _tube(row), f"{1e3 * row.mass:.4g} g"]
        lines.append(f"| {' | '.join(cells)} |")
    length, mass = sum(row.length for row in rows), sum(row.mass for row in rows)
    cost = sum(link.price for link in arm.links)
    price = f", {cost:,.2f} USD" if cost else ""
    lines += ["", f"Together {1e3 * length:.1f} mm of links, {1e3 * mass:.4g} g{price}."]
    if arm.column is not None:
        lines += ["", _column(arm.column)]
    if any(arm.tool.tip):
        shift = ", ".join(f"{1e3 * value:.1f}" for value in arm.tool.tip)
        lines += ["", f"The tool reaches ({shift}) mm from the end of the last link to the tip."]
    if arm.tool.mass > 0.0:
        lines += ["", f"The tool has {1e3 * arm.tool.mass:.4g} g."]
    lines += _actuator_lines(arm)
    lines += _body_lines(arm)
    lines += [f"\n{note}" for note in notes]
    return "\n".join(lines) + "\n"


def _tube(row: SheetRow) -> str:
    """Return the outer diameter and, if known, the wall of a link's tube; empty without length."""
    if row.length == 0.0:
        return ""
    wall = "" if row.wall is None else f" x {1e3 * row.wall:g}"
    return f"{1e3 * row.outer_diameter:g}{wall} mm"


def _column(column: Column) -> str:
    """Return what to cut for the column."""
    price = f", {column.price:,.2f} USD" if column.price else ""
    return (
        f"The base stands on a column of {1e3 * column.length:.1f} mm, a tube of {1e3 * column.outer_diameter:g} x "
        f"{1e3 * column.wall:g} mm, {1e3 * column.mass:.4g} g{price}."
    )


def _actuator_lines(arm: Arm) -> list[str]:
    motors = [joint.actuator for joint in arm.joints if joint.actuator is not None]
    if not motors:
        return []
    prices = [motor.price for motor in motors]
    price = "" if None in prices else f", {sum(price or 0.0 for price in prices):,.0f} USD"
    mass = 1e3 * sum(motor.mass for motor in motors)
    text = f"Percentages are of their peak torques, with a safety factor of {arm.safety_factor:g}."
    ratings = [f"- {_ratings(motor)}" for motor in dict.fromkeys(motors)]
    return ["", f"{len(motors)} actuators of {mass:.4g} g{price}. {text}", "", *ratings]


def _body_lines(arm: Arm) -> list[str]:
    """Return where the bodies of the actuators are, if they count."""
    bodies = [(n, joint.body) for n, joint in enumerate(arm.joints, start=1) if joint.body is not None]
    if not bodies:
        return []
    lines = [
        "",
        "Bodies of the actuators, with all joints at 0: edges along x, y and z, and the middle from the joint.",
        "",
    ]
    for n, body in bodies:
        edges = " x ".join(f"{1e3 * edge:.4g}" for edge in body.size)
        middle = ", ".join(f"{1e3 * value:.4g}" for value in body.centre)
        lines.append(f"- joint {n}: {body.shape} of {edges} mm, shaft along {body.axis}, middle at ({middle}) mm")
    return lines


def _ratings(motor: Actuator) -> str:
    stated = [
        ("peak {:.4g} N m", motor.peak_torque),
        ("continuous {:.4g} N m", motor.continuous_torque),
        ("no-load speed {:.4g} rad/s", motor.speed),
        ("{:g} V", motor.voltage),
    ]
    return f"{motor.name}: " + ", ".join(text.format(value) for text, value in stated if value is not None)
