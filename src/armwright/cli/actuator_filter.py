"""Choose actuators by bounds of their values."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from armwright.exceptions import FailureError, SettingsError, did_you_mean
from armwright.problem.conditions import Condition, read_bound, read_condition
from armwright.robot.actuators import UNITS, ActuatorRecord, value_of

VALUES = {"torque": "peak_torque"}  # options whose name is shorter than that of the value


@dataclass(frozen=True)
class ActuatorFilter:
    """Conditions on values of actuators, defaults of their kind included. An unknown value satisfies none."""

    conditions: Sequence[Condition]

    @classmethod
    def of(cls, bounds: Mapping[str, str | None], where: Sequence[str]) -> "ActuatorFilter":
        """Parse bounds by the name of their option, and conditions.

        Raises:
            SettingsError: One is no bound, names an unknown value, or has another unit.
        """
        stated = [
            read_bound(f"--{name}", VALUES.get(name, name), text) for name, text in bounds.items() if text is not None
        ]
        return cls([_in_unit(condition) for condition in (*stated, *map(read_condition, where))])

    def apply(self, records: Sequence[ActuatorRecord]) -> list[ActuatorRecord]:
        """Return the actuators that satisfy all conditions.

        Raises:
            FailureError: There is none.
        """
        left = [record for record in records if all(_holds(condition, record) for condition in self.conditions)]
        if not left and records:
            raise FailureError(f"none of {len(records)} actuators has {self._description}; try looser bounds")
        return left

    def unknown(self, records: Sequence[ActuatorRecord]) -> dict[str, int]:
        """Return how many actuators lack a value that a condition bounds, by its name."""
        missing = {
            condition.name: sum(value_of(record.completed(), condition.name) is None for record in records)
            for condition in self.conditions
        }
        return {name: count for name, count in missing.items() if count}

    @property
    def _description(self) -> str:
        return " and ".join(
            f"{condition.name} {condition.relation} {condition.bound:g} {UNITS[condition.name]}".rstrip()
            for condition in self.conditions
        )


def _in_unit(condition: Condition) -> Condition:
    """Return a condition with its bound in the unit of the catalogue."""
    if condition.name not in UNITS:
        hint = did_you_mean(condition.name, UNITS)
        raise SettingsError(f'unknown value "{condition.name}".{hint} Available: {", ".join(UNITS)}')
    return condition.in_unit(UNITS[condition.name])


def _holds(condition: Condition, record: ActuatorRecord) -> bool:
    value = value_of(record.completed(), condition.name)
    return value is not None and condition.holds({condition.name: value})
