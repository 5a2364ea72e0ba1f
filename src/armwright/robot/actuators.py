"""Real actuators from the data sheets of their makers, in actuators.csv.

A space file names actuators of the catalogue, or describes others. Values without a source are empty.
"""

import csv
from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Any, Literal

from pydantic import BaseModel, Field

from armwright.exceptions import SpaceError, did_you_mean
from armwright.robot.arm import Actuator

CATALOGUE = "actuators.csv"
TorqueKind = Literal["stall", "rated", "peak"]


class ActuatorRecord(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """The data sheet of an actuator; None for values that it does not state.

    Masses in kg, torques in N m, speed in rad/s without load, size in m, price in USD.
    """

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,39}$")  # used in space files and tables
    maker: str = Field(default="", max_length=100)
    kind: str = Field(default="", max_length=40)  # such as servo or gear motor
    voltage: float | None = Field(default=None, gt=0.0)  # for which the values hold [V]
    mass: float = Field(ge=0.0, le=1e4)  # [kg]
    stall_torque: float | None = Field(default=None, gt=0.0, le=1e6)  # [N m]
    rated_torque: float | None = Field(default=None, gt=0.0, le=1e6)  # continuous [N m]
    peak_torque: float | None = Field(default=None, gt=0.0, le=1e6)  # intermittent [N m]
    speed: float | None = Field(default=None, gt=0.0)  # no-load [rad/s]
    width: float | None = Field(default=None, gt=0.0)  # [m]
    height: float | None = Field(default=None, gt=0.0)  # [m]
    depth: float | None = Field(default=None, gt=0.0)  # [m]
    price: float | None = Field(default=None, ge=0.0)  # [USD]
    source: str = Field(default="", max_length=500)
    note: str = Field(default="", max_length=1000)

    def torque(self, kind: TorqueKind) -> float | None:
        """Return the stall, rated or peak torque [N m]."""
        return {"stall": self.stall_torque, "rated": self.rated_torque, "peak": self.peak_torque}[kind]

    def actuator(self, kind: TorqueKind, safety_factor: float) -> Actuator:
        """Return the actuator of an arm, with this torque divided by the safety factor.

        Raises:
            SpaceError: If that torque is not stated.
        """
        torque = self.torque(kind)
        if torque is None:
            stated = [other for other in ("stall", "rated", "peak") if self.torque(other) is not None]
            known = f"its {' and '.join(stated)} torque is known" if stated else "none is known"
            raise SpaceError(f"actuator {self.name} has no {kind} torque, {known}; choose another by actuator_torque")
        return Actuator(self.name, self.mass, torque / safety_factor, self.speed, self.price)


@cache
def catalogue() -> Mapping[str, ActuatorRecord]:
    """Return the actuators that come with armwright, by name."""
    text = (resources.files("armwright.robot") / CATALOGUE).read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    records = [
        ActuatorRecord.model_validate({key: value for key, value in row.items() if value})
        for row in csv.DictReader(lines)
    ]
    return {record.name: record for record in records}


def resolve_actuator(entry: Any) -> Any:
    """Return the record of a named actuator; anything else unchanged, for pydantic to validate."""
    if not isinstance(entry, str):
        return entry
    known = catalogue()
    if entry not in known:
        raise ValueError(
            f'unknown actuator "{entry}".{did_you_mean(entry, known)} `armwright actuators` lists the {len(known)} of '
            "the catalogue; others are described by name, mass [kg] and stall_torque [N m]"
        )
    return known[entry]
