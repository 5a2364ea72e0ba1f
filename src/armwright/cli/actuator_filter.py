"""Choose actuators by bounds of their values."""

from collections.abc import Sequence

from armwright.exceptions import FailureError, SettingsError, did_you_mean
from armwright.problem.conditions import Condition, read_condition
from armwright.robot.actuators import UNITS, ActuatorRecord, value_of


def read_conditions(where: Sequence[str]) -> list[Condition]:
    """Parse conditions on values of actuators, with their bounds in the units of the catalogue.

    Raises:
        SettingsError: One is no condition, names an unknown value, or has another unit.
    """
    conditions = [read_condition(text) for text in where]
    for one in conditions:
        if one.name not in UNITS:
            hint = did_you_mean(one.name, UNITS)
            raise SettingsError(f'unknown value "{one.name}".{hint} Available: {", ".join(UNITS)}')
    return [one.in_unit(UNITS[one.name]) for one in conditions]


def choose(records: Sequence[ActuatorRecord], conditions: Sequence[Condition]) -> list[ActuatorRecord]:
    """Return the actuators that satisfy all conditions, defaults of their kind included; unknown values satisfy none.

    Raises:
        FailureError: There is none.
    """
    left = [record for record in records if all(_holds(condition, record) for condition in conditions)]
    if not left and records:
        bounds = " and ".join(
            f"{one.name} {one.relation} {one.bound:g} {UNITS[one.name]}".rstrip() for one in conditions
        )
        raise FailureError(f"none of {len(records)} actuators has {bounds}; try looser bounds")
    return left


def count_unknown(records: Sequence[ActuatorRecord], name: str) -> int:
    """Return how many actuators lack a value."""
    return sum(value_of(record.completed(), name) is None for record in records)


def _holds(condition: Condition, record: ActuatorRecord) -> bool:
    value = value_of(record.completed(), condition.name)
    return value is not None and condition.holds({condition.name: value})
