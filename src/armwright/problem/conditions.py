"""Conditions on quantities, such as `price <= 200 USD`, as users write them."""

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from armwright.exceptions import SettingsError
from armwright.units import NUMBER, OTHER_UNITS

_CONDITION = re.compile(rf"\s*([A-Za-z_]\w*)\s*(<=|>=|==|<|>)\s*({NUMBER})\s*([^\W\d][^<>=]*)?")
_HOLDS = {"<=": np.less_equal, ">=": np.greater_equal, "<": np.less, ">": np.greater, "==": np.equal}


@dataclass(frozen=True)
class Condition:
    """A bound for a quantity."""

    name: str
    relation: str  # `<=`, `<`, `==`, `>` or `>=`
    bound: float
    unit: str = ""  # the unit of the bound as it was written; empty for that of the quantity

    def holds(self, numbers: Mapping[str, float]) -> bool:
        """Return whether these quantities satisfy the condition."""
        return bool(_HOLDS[self.relation](numbers[self.name], self.bound))

    def in_unit(self, unit: str) -> "Condition":
        """Return the condition with its bound in the unit of the quantity; SettingsError if it is in another one."""
        if self.unit in ("", unit):
            return Condition(self.name, self.relation, self.bound)
        measured, size = OTHER_UNITS.get(self.unit, (None, 1.0))
        if measured != unit:
            known = [unit, *(name for name, (of, _) in OTHER_UNITS.items() if of == unit)] if unit else []
            expected = f"a bound in {' or '.join(known)}" if known else "a number without a unit"
            raise SettingsError(f"{self.name}: expected {expected}, got {self.bound:g} {self.unit}")
        return Condition(self.name, self.relation, self.bound * size)


def read_condition(text: str) -> Condition:
    """Parse a condition such as `position_error<=0.05` or `mass<2 kg`; SettingsError if it is none."""
    found = _CONDITION.fullmatch(text)
    if found is None:
        raise SettingsError(f'--where "{text}": expected a name, one of <= < == > >= and a number, such as mass<=2.5')
    name, relation, bound, unit = found.groups("")
    return Condition(name, relation, float(bound), unit.strip())
