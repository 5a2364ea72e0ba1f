"""Real actuators from the data sheets of their makers, in actuators.csv.

A space file names actuators of the catalogue, or describes others. Values that no source states are empty in the file,
and get the default of the actuator's kind.
"""

import csv
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import cache
from importlib import resources
from typing import Any, Literal, cast, get_args

import numpy as np
from pydantic import BaseModel, Field, model_validator

from armwright.arrays import Array
from armwright.exceptions import SpaceError, did_you_mean
from armwright.robot.actuator_defaults import DEFAULTS, ActuatorKind, default_shape, default_values
from armwright.robot.arm import Actuator
from armwright.robot.motor_body import ActuatorShape, BodyShape
from armwright.schema_types import members_of
from armwright.units import KEY_UNITS

CATALOGUE = "actuators.csv"
SOURCES = "actuator_sources.csv"
VOLTAGES = "actuator_voltages.csv"
ESTIMATE = "~"  # before the code of a source from which a value is estimated
Edge = Literal["width", "height", "depth"]

VOLTAGE_DRIVEN: tuple[ActuatorKind, ...] = ("servo", "coreless servo")  # without a limit of the current
DIMENSIONS: tuple[Edge, ...] = get_args(Edge)
SEVERAL = re.compile("([2-4])x")  # key of a space file for several actuators at one joint
ADDED = (  # values of several actuators at one joint that add up
    "mass", "bracket_mass", "stall_torque", "rated_torque", "peak_torque", "rotor_inertia", "coulomb_friction",
    "viscous_friction", "joint_stiffness", "position_gain", "damping_gain", "current", "tilting_limit", "axial_limit",
    "radial_limit", "price",
)  # fmt: skip


class ActuatorRecord(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """The data sheet of an actuator, all values at its output; None for values that it does not state."""

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,39}$")  # used in space files and tables
    maker: str = Field(default="", max_length=100)
    kind: ActuatorKind = "servo"  # selects the defaults of missing values
    voltage: float | None = Field(default=None, gt=0.0)  # for which the values hold [V]
    voltage_min: float | None = Field(default=None, gt=0.0)  # lowest supply [V]
    voltage_max: float | None = Field(default=None, gt=0.0)  # highest supply [V]
    # other supplies [V], with the torque at rest [N m] and the no-load speed [rad/s] there
    at_voltages: tuple[tuple[float, float, float], ...] = Field(default=(), max_length=20)
    mass: float = Field(ge=0.0, le=1e4)  # [kg]
    bracket_mass: float | None = Field(default=None, ge=0.0, le=1e4)  # of brackets and screws that hold it [kg]
    stall_torque: float | None = Field(default=None, gt=0.0, le=1e6)  # [N m]
    rated_torque: float | None = Field(default=None, gt=0.0, le=1e6)  # continuous [N m]
    peak_torque: float | None = Field(default=None, gt=0.0, le=1e6)  # intermittent [N m]
    speed: float | None = Field(default=None, gt=0.0, le=1e6)  # no-load [rad/s]
    corner_speed: float | None = Field(default=None, ge=0.0)  # up to which the peak torque is available [rad/s]
    gear_ratio: float | None = Field(default=None, gt=0.0)
    rotor_inertia: float | None = Field(default=None, ge=0.0, le=1e6)  # of rotor and gear at the output [kg m²]
    coulomb_friction: float | None = Field(default=None, ge=0.0, le=1e6)  # [N m]
    viscous_friction: float | None = Field(default=None, ge=0.0, le=1e6)  # [N m s/rad]
    load_friction: float | None = Field(default=None, ge=0.0, le=10.0)  # relative to the torque that it passes on
    backlash: float | None = Field(default=None, ge=0.0)  # [rad]
    joint_stiffness: float | None = Field(default=None, gt=0.0)  # of gear and output at rest [N m/rad]
    position_gain: float | None = Field(default=None, gt=0.0)  # of its position control [N m/rad]
    damping_gain: float | None = Field(default=None, ge=0.0)  # of its position control [N m s/rad]
    current: float | None = Field(default=None, gt=0.0)  # drawn from the supply at the peak torque [A]
    width: float | None = Field(default=None, gt=0.0)  # [m]
    height: float | None = Field(default=None, gt=0.0)  # [m]
    depth: float | None = Field(default=None, gt=0.0)  # [m]
    shape: BodyShape | None = None  # a cylinder is about its shaft
    shaft_edge: Edge | None = None  # the edge along the shaft
    shaft_offset: float | None = Field(default=None, ge=0.0)  # of the shaft from the middle, along the longer edge [m]
    bearing_offset: float | None = Field(default=None, ge=0.0)  # of the bearing from the middle, along the shaft [m]
    tilting_limit: float | None = Field(default=None, gt=0.0)  # largest moment across the shaft [N m]
    axial_limit: float | None = Field(default=None, gt=0.0)  # largest force along the shaft [N]
    radial_limit: float | None = Field(default=None, gt=0.0)  # largest force across the shaft [N]
    price: float | None = Field(default=None, ge=0.0)  # [USD]
    estimates: tuple[str, ...] = ()  # the stated values that are estimated from a source, not stated by it
    source: str = Field(default="", max_length=500)
    note: str = Field(default="", max_length=1000)

    @model_validator(mode="after")
    def _check(self) -> "ActuatorRecord":
        if self.stall_torque is None and self.peak_torque is None and self.rated_torque is None:
            raise ValueError(f"actuator {self.name} states no torque; give stall_torque, peak_torque or rated_torque")
        if self.speed is not None and (self.corner_speed or 0.0) > self.speed:
            raise ValueError(f"actuator {self.name}: corner_speed is above the no-load speed of {self.speed:g} rad/s")
        low, high = self.supply_range
        stated = [one[0] for one in self.at_voltages]
        if stated and (self.voltage is None or self.speed is None or min(map(min, self.at_voltages)) <= 0.0):
            raise ValueError(f"actuator {self.name}: at_voltages needs voltage, speed, and values above 0")
        if not all(low <= volts <= high for volts in (self.voltage or low, *stated)):
            raise ValueError(f"actuator {self.name} states voltages outside its range of {low:g} to {high:g} V")
        for name in self.estimates:
            if name not in UNITS or getattr(self, name) is None:
                raise ValueError(f"actuator {self.name}: estimates names {name}, which has no value")
        return self

    @property
    def supply_range(self) -> tuple[float, float]:
        """The lowest and the highest supply [V]; without a voltage, 0 and infinity."""
        if self.voltage is None:
            return 0.0, math.inf
        defaults = self._defaults()
        return self.voltage_min or defaults["voltage_min"], self.voltage_max or defaults["voltage_max"]

    @property
    def stated_supply(self) -> float:
        """The highest supply that its maker states [V]; without a voltage, infinity."""
        points = [volts for volts, *_ in self.at_voltages]
        return self.voltage_max or max((self.voltage or math.inf, *points))

    @property
    def assumed(self) -> tuple[str, ...]:
        """Names of the values that are estimates or defaults of the kind, in the order of the catalogue."""
        defaults = self._defaults()
        return tuple(name for name in UNITS if name in self.estimates or name in defaults)

    @property
    def body_shape(self) -> ActuatorShape | None:
        """The shape about its shaft; None if a dimension is missing.

        By default the shaft is the axis of a cylinder, and as far from the near end of a box as from the sides, as that
        of servos.
        """
        if self.width is None or self.height is None or self.depth is None:
            return None
        edges = {"width": self.width, "height": self.height, "depth": self.depth}
        shape, shaft_edge = default_shape(self.kind, **edges)
        length = edges.pop(self.shaft_edge or shaft_edge)
        short, long = sorted(edges.values())
        shape = self.shape or shape
        short = long if shape == "cylinder" else short
        offset = (long - short) / 2 if self.shaft_offset is None else self.shaft_offset
        return ActuatorShape(shape, length, long, short, offset)

    def completed(self) -> "ActuatorRecord":
        """Return the record with the defaults of its kind in place of missing numbers.

        Without a no-load speed or a voltage, the values that depend on it stay missing.
        """
        return self.model_copy(update={"peak_torque": self.peak_torque or self.stall_torque} | self._defaults())

    def scaled(self, names: Iterable[str], factor: float) -> "ActuatorRecord":
        """Return the completed record with these values multiplied; a corner speed stays within the no-load speed."""
        record = self.completed()
        values = {name: factor * value for name in names if (value := value_of(record, name)) is not None}
        if "stall_torque" in values and self.peak_torque is None:
            values["peak_torque"] = values["stall_torque"]
        own = {"voltage_min": self.voltage_min, "voltage_max": self.voltage_max}  # not those that are assumed
        record = record.model_copy(update=values | own)
        if record.corner_speed is None or record.speed is None:
            return record
        return record.model_copy(update={"corner_speed": min(record.corner_speed, record.speed)})

    def several(self, count: int) -> "ActuatorRecord":
        """Return as one the completed actuators that turn a joint together, side by side along its shaft."""
        record = self.scaled(ADDED, count)
        values: dict[str, Any] = {
            "name": f"{count}x-{self.name}",
            "at_voltages": tuple((volts, count * torque, speed) for volts, torque, speed in self.at_voltages),
            "estimates": tuple(name for name in self.assumed if value_of(record, name) is not None),
        }
        if self.width is not None and self.height is not None and self.depth is not None:
            shape, edge = default_shape(self.kind, self.width, self.height, self.depth)
            edge = self.shaft_edge or edge
            values |= {"shape": self.shape or shape, "shaft_edge": edge, edge: count * getattr(self, edge)}
        return record.model_copy(update=values)

    def at_supply(self, volts: float) -> "ActuatorRecord":
        """Return the completed record at a supply [V], which is then the only one that it takes.

        Between the voltages for which torque and speed are stated, both are interpolated. Beyond,
        `torque_at_voltage` applies. A DC servo whose line starts at rest has no controller that limits the current, so
        its torque at rest grows with the voltage, too. Without a stated voltage, the values are those of any supply.
        """
        record = self.completed()
        if record.voltage is None or not math.isfinite(volts):
            return record
        if record.at_voltages and record.peak_torque and record.speed:
            points = sorted([(record.voltage, record.peak_torque, record.speed), *record.at_voltages])
            stated = [point[0] for point in points]
            near = min(max(volts, stated[0]), stated[-1])
            torque, speed = (float(np.interp(near, stated, [point[i] for point in points])) for i in (1, 2))
            record = record._at(near / record.voltage, speed / record.speed, torque / record.peak_torque)
        share, speed = volts / (record.voltage or volts), record.speed or 1.0
        is_servo = self.kind in VOLTAGE_DRIVEN and not record.corner_speed
        torque = share if is_servo else float(torque_at_voltage(share, speed, speed - (record.corner_speed or 0.0)))
        return record._at(share, share, torque)

    def _at(self, share: float, speed: float, torque: float) -> "ActuatorRecord":
        """Return a completed record at a share of its voltage, by the factors of no-load speed and torque at rest."""
        factors = {"voltage": share, "speed": speed, "peak_torque": torque, "stall_torque": torque}
        factors |= {"current": torque**2 / share}  # copper loss over the voltage
        factors |= {"position_gain": torque} if self.kind in VOLTAGE_DRIVEN else {}  # a share of the voltage by angle
        values = {name: factor * value for name, factor in factors.items() if (value := value_of(self, name))}
        if self.speed is not None:  # the slope of the line stays
            corner = torque * (self.corner_speed or 0.0) + (speed - torque) * self.speed
            values["corner_speed"] = max(0.0, corner)
        pinned = {"voltage_min": values.get("voltage"), "voltage_max": values.get("voltage"), "at_voltages": ()}
        return self.model_copy(update=values | pinned)

    def _defaults(self) -> dict[str, float]:
        """Return the defaults of the values that are not stated. The stall torque is a peak torque, if it is stated."""
        rated = self.rated_torque or 0.0
        # Without a published peak, the rated torque is all that may be drawn; rotor and friction suit twice as much.
        reference = self.stall_torque or self.peak_torque or 2.0 * rated
        values = default_values(self.kind, self.mass, reference, self.speed, self.voltage, self.position_gain)
        for volts, *_ in self.at_voltages:
            values["voltage_min"] = min(volts, values.get("voltage_min", volts))
            values["voltage_max"] = max(volts, values.get("voltage_max", volts))
        if self.stall_torque is None:
            values["peak_torque"] = rated
        if (body := self.body_shape) is not None:
            values["shaft_offset"] = body.shaft_offset
        return {name: value for name, value in values.items() if getattr(self, name) is None}

    def actuator(self) -> Actuator:
        """Return the actuator of an arm, with the values of `completed`."""
        values = dict(self.completed())
        values |= {"continuous_torque": values["rated_torque"], "shape": self.body_shape}
        values["limit_friction"] = values["load_friction"] if DEFAULTS[self.kind].before_friction else 0.0
        return Actuator(**{field.name: values[field.name] for field in fields(Actuator)})


def torque_at_voltage(share: float, no_load_speed: Array | float, falling_range: Array | float) -> Array:
    """Return the factor of the peak torque P of motors at a share s of their voltage.

    The falling line of torque over speed shifts in parallel, because the back-EMF takes what the winding lacks
    (Siciliano et al. 2009, section 5.2): with the no-load speed ω₀ and the corner speed ω_c,

        ω₀' = s ω₀ ,   ω_c' = max(0, ω_c - (1 - s) ω₀) ,   P' = P min(1, s ω₀ / (ω₀ - ω_c))

    Up to a corner speed, the controller limits the current: the peak torque stays as long as the line allows it.
    Copper loss at a torque does not change, nor does the continuous torque.
    """
    with np.errstate(divide="ignore"):
        return np.minimum(1.0, share * np.asarray(no_load_speed) / falling_range)


UNITS: Mapping[str, str] = {  # of all values that a record may state; empty for a number without a unit
    name: KEY_UNITS.get(name, "")
    for name, field in ActuatorRecord.model_fields.items()
    if float in members_of(field.annotation)
}


def value_of(record: ActuatorRecord, name: str) -> float | None:
    """Return the value of this name, a key of UNITS."""
    value: float | None = getattr(record, name)
    return value


@dataclass(frozen=True)
class Source:
    """The source of a value."""

    address: str  # where it is published
    statement: str  # what is stated there, and how the value follows from it


@cache
def catalogue() -> Mapping[str, ActuatorRecord]:
    """Return the actuators that come with armwright, by name."""
    records: dict[str, ActuatorRecord] = {}
    supplies: dict[str, list[list[float]]] = {}
    for row in _rows(VOLTAGES):
        supplies.setdefault(row.pop("name"), []).append([float(value) for value in row.values() if value])
    for row in _rows(CATALOGUE):
        codes = _codes(row.pop("sources"))
        values: dict[str, Any] = {key: value for key, value in row.items() if value}
        if stated := supplies.get(row["name"]):
            volts = [float(row["voltage"]), *(one for one, *_ in stated)]
            values |= {"voltage_min": min(volts), "voltage_max": max(volts)}
            values["at_voltages"] = [one for one in stated if len(one) > 1]
        values["estimates"] = tuple(name for name, code in codes.items() if code.startswith(ESTIMATE))
        records[row["name"]] = ActuatorRecord.model_validate(values)
    return records


@cache
def catalogue_sources() -> Mapping[str, Mapping[str, Source]]:
    """Return the sources of values by actuator and value; other values are stated by the source of the actuator."""
    known = {row["code"]: Source(row["address"], row["statement"]) for row in _rows(SOURCES)}
    sources: dict[str, Mapping[str, Source]] = {}
    for row in _rows(CATALOGUE):
        found = {name: known[code.removeprefix(ESTIMATE)] for name, code in _codes(row["sources"]).items()}
        sources[row["name"]] = {
            name: replace(one, address=row["source"]) if one.address == "page" else one for name, one in found.items()
        }
    return sources


def _rows(file: str) -> Iterator[dict[str, str]]:
    text = (resources.files("armwright.robot") / file).read_text(encoding="utf-8")
    yield from csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))


def _codes(sources: str) -> dict[str, str]:
    """Return the codes of sources by name of the value."""
    return {name: code for name, _, code in (part.partition("=") for part in sources.split())}


def named_actuator(name: str) -> ActuatorRecord:
    """Return an actuator of the catalogue; SpaceError if it has none of this name."""
    known = catalogue()
    if name not in known:
        raise SpaceError(
            f'unknown actuator "{name}".{did_you_mean(name, known)} `armwright actuators` lists the {len(known)} of '
            "the catalogue; others are described by name, mass [kg] and stall_torque [N m]"
        )
    return known[name]


def resolve_actuator(entry: Any) -> Any:
    """Return the record of a named actuator, or of `{2x: NAME}`; anything else unchanged, for pydantic to validate."""
    if isinstance(cast("object", entry), dict) and len(entry) == 1:
        ((key, each),) = entry.items()
        if several := SEVERAL.fullmatch(str(key)):
            return ActuatorRecord.model_validate(resolve_actuator(each)).several(int(several[1]))
    if not isinstance(entry, str):
        return entry
    try:
        return named_actuator(entry)
    except SpaceError as error:
        raise ValueError(str(error)) from None
