"""The mass of a design by parts, and its parts list with prices and sources."""

import re
from collections.abc import Iterator

from armwright.robot.actuators import ActuatorRecord
from armwright.robot.arm import Actuator, Arm, Link
from armwright.robot.tubes import Tube
from armwright.sheet.record import MassLine, Part
from armwright.spaces.design_space import DesignSpace

_SENTENCE = re.compile(r"(?:[^;()]|\([^()]*+\)|[()])++")  # of a note: up to a semicolon outside parentheses
NEGLIGIBLE = 1e-9  # [kg]


def mass_lines(arm: Arm) -> tuple[MassLine, ...]:
    """Return the parts of a design's mass; they sum up to it."""
    actuators = sum(joint.actuator.mass for joint in arm.joints if joint.actuator is not None)
    carried = arm.base_mass + sum(link.end_mass for link in arm.links)
    lines = [MassLine(f"link {n}", link.mass) for n, link in enumerate(arm.links, start=1) if link.mass > 0.0]
    lines += [MassLine("actuators", actuators), MassLine("brackets, screws and rails", carried - actuators)]
    lines += [] if arm.column is None else [MassLine("column", arm.column.mass)]
    lines.append(MassLine("tool", arm.tool.mass))
    return tuple(line for line in lines if line.mass > NEGLIGIBLE)


def parts_list(arm: Arm, space: DesignSpace) -> tuple[Part, ...]:
    """Return the parts list of a design of a space; a price is None if the space or the catalogue states none."""
    return (*_actuators(arm, space), *_tubes(arm, space), *_column(arm), *_others(arm, space))


def _actuators(arm: Arm, space: DesignSpace) -> Iterator[Part]:
    records = {record.name: record for record in space.actuators}
    names = [joint.actuator.name for joint in arm.joints if joint.actuator is not None]
    motors = {joint.actuator.name: joint.actuator for joint in arm.joints if joint.actuator is not None}
    for name, motor in motors.items():
        record, count = records[name], names.count(name)
        made = f"{record.maker} {record.kind}".strip()
        yield Part(
            part=name,
            count=count,
            unit_price=record.price,
            price=None if record.price is None else count * record.price,
            detail=f"{made}, {1e3 * record.mass:.4g} g each{_ratings(motor)}",
            source=record.source,
            price_source=price_source(record),
        )


def _ratings(motor: Actuator) -> str:
    stated = [
        (", peak {:.4g} N m", motor.peak_torque),
        (", continuous {:.4g} N m", motor.continuous_torque),
        (", no-load speed {:.4g} rad/s", motor.speed),
        (", {:g} V", motor.voltage),
    ]
    return "".join(text.format(value) for text, value in stated if value is not None)


def price_source(record: ActuatorRecord) -> str:
    """Return what the note of an actuator says of its price; empty if it says nothing."""
    if record.price is None:
        return ""
    return "; ".join(part.strip() for part in _SENTENCE.findall(record.note) if "price" in part.lower())


def _tubes(arm: Arm, space: DesignSpace) -> Iterator[Part]:
    material = space.link_section.material
    of_tube: dict[str, list[Link]] = {}
    for link in arm.links:
        if link.length > 0.0:
            name = "link" if link.wall is None else f"tube {Tube(2.0 * link.radius, link.wall).name} mm"
            of_tube.setdefault(name, []).append(link)
    for name, links in of_tube.items():
        price = sum(link.price for link in links)
        cuts = ", ".join(f"{1e3 * link.length:.1f}" for link in links)
        kind = f"{material.name or 'custom material'}, " if material is not None else ""
        yield Part(
            part=name,
            count=len(links),
            price=price or None,
            detail=f"{kind}cut to {cuts} mm",
            price_source="price per kg of the space file" if price else "",
        )


def _column(arm: Arm) -> Iterator[Part]:
    if arm.column is not None:
        name = Tube(arm.column.outer_diameter, arm.column.wall).name
        price = arm.column.price or None
        detail = f"cut to {1e3 * arm.column.length:.1f} mm"
        note = "price per metre of the space file" if price else ""
        yield Part(f"column, tube {name} mm", 1, price, price, detail, price_source=note)


def _others(arm: Arm, space: DesignSpace) -> Iterator[Part]:
    n = sum(joint.kind != "fixed" for joint in arm.joints)
    if space.bracket_mass > 0.0:
        yield Part("brackets and screws", n, detail=f"{1e3 * space.bracket_mass:.4g} g for each joint")
    if arm.tool.mass > 0.0:
        yield Part("tool", 1, detail=f"{1e3 * arm.tool.mass:.4g} g")
