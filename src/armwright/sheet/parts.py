"""The mass of a design by parts, and parts lists with prices and sources."""

import math
import re
from collections.abc import Iterator, Sequence

from armwright.robot.actuators import ActuatorRecord
from armwright.robot.arm import Arm, Link
from armwright.robot.tubes import Tube
from armwright.sheet.record import MassLine, Part
from armwright.spaces.design_space import DesignSpace

_SENTENCE = re.compile(r"(?:[^;()]|\([^()]*+\)|[()])++")  # of a note: up to a semicolon outside parentheses
NEGLIGIBLE = 1e-9  # [kg]
RATINGS = {
    "peak_torque": ", peak {:.4g} N m",
    "continuous_torque": ", continuous {:.4g} N m",
    "speed": ", no-load speed {:.4g} rad/s",
    "voltage": ", {:g} V",
}


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
    records = {record.name: record for record in space.actuators}
    motors = [joint.actuator for joint in arm.joints if joint.actuator is not None]
    used = [records[motor.name].at_supply(motor.voltage or math.nan) for motor in motors]
    return (*_actuators(used), *_tubes(arm, space), *_others(arm, space))


def _actuators(records: Sequence[ActuatorRecord]) -> Iterator[Part]:
    """Yield a line for each kind of actuator among those of an arm."""
    for record in dict.fromkeys(records):
        count, motor = records.count(record), record.actuator()
        stated = {text: getattr(motor, name) for name, text in RATINGS.items()}
        ratings = "".join(text.format(value) for text, value in stated.items() if value is not None)
        notes = () if record.price is None else map(str.strip, _SENTENCE.findall(record.note))
        yield Part(
            part=record.name,
            count=count,
            unit_price=record.price,
            price=None if record.price is None else count * record.price,
            detail=f"{f'{record.maker} {record.kind}'.strip()}, {1e3 * record.mass:.4g} g each{ratings}",
            source=record.source,
            price_source="; ".join(note for note in notes if "price" in note.lower()),
        )


def _tubes(arm: Arm, space: DesignSpace) -> Iterator[Part]:
    material = space.link_section.material
    kind = "" if material is None else f"{material.name or 'custom material'}, "
    of_tube: dict[str, list[Link]] = {}
    for link in arm.links:
        if link.length > 0.0:
            name = "link" if link.wall is None else f"tube {Tube(2.0 * link.radius, link.wall).name} mm"
            of_tube.setdefault(name, []).append(link)
    for name, links in of_tube.items():
        price = sum(link.price for link in links)
        detail = f"{kind}cut to {', '.join(f'{1e3 * link.length:.1f}' for link in links)} mm"
        source = "price per kg of the space file" if price else ""
        yield Part(name, len(links), price=price or None, detail=detail, price_source=source)
    if arm.column is not None:
        name = f"column, tube {Tube(arm.column.outer_diameter, arm.column.wall).name} mm"
        price, detail = arm.column.price or None, f"cut to {1e3 * arm.column.length:.1f} mm"
        yield Part(name, 1, price, price, detail, price_source="price per metre of the space file" if price else "")


def _others(arm: Arm, space: DesignSpace) -> Iterator[Part]:
    n = sum(joint.kind != "fixed" for joint in arm.joints)
    low, high = min(space.bracket_masses), max(space.bracket_masses)
    if high > 0.0:
        each = f"{1e3 * low:.4g} g" if low == high else f"{1e3 * low:.3g} to {1e3 * high:.3g} g"
        yield Part("brackets and screws", n, detail=f"{each} for each joint")
    if arm.tool.mass > 0.0:
        yield Part("tool", 1, detail=f"{1e3 * arm.tool.mass:.4g} g")
