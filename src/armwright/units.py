"""Units of the keys of files, and other units that people write."""

import math
import re
from collections.abc import Mapping

# Units that people write beside those of this program: what they measure, and their size
OTHER_UNITS: Mapping[str, tuple[str, float]] = {
    "mm": ("m", 1e-3),
    "cm": ("m", 1e-2),
    "g": ("kg", 1e-3),
    "mA": ("A", 1e-3),
    "ms": ("s", 1e-3),
    "deg": ("rad", math.pi / 180.0),
    "°": ("rad", math.pi / 180.0),
    "rpm": ("rad/s", math.pi / 30.0),
}
_KEYS = {
    "m": "targets position tolerance target_noise tip center size radius height z approach path low high stroke "
    "origin_x origin_y origin_z link outer_diameter wall foot tubes width depth shaft_offset bearing_offset",
    "rad": "angle_tolerance angle half_angle rpy yaw joint_range limit backlash",
    "kg": "payload mass bracket_mass kg",
    "s": "dwell time",
    "kg m²": "inertia rotor_inertia",
    "m/rad": "travel",
    "kg/m³": "density",
    "Pa": "youngs shear",
    "USD": "price",
    "USD/m": "price_per_metre",
    "USD/kg": "price_per_kg",
    "V": "voltage voltage_min voltage_max supply",
    "A": "current",
    "N m": "stall_torque rated_torque peak_torque coulomb_friction tilting_limit",
    "N": "axial_limit radial_limit",
    "rad/s": "speed corner_speed",
    "N m s/rad": "viscous_friction damping_gain",
    "N m/rad": "joint_stiffness position_gain",
}
KEY_UNITS: Mapping[str, str] = {key: unit for unit, keys in _KEYS.items() for key in keys.split()}
UNSIGNED = r"(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?"  # a decimal number as people write it, for patterns
NUMBER = rf"[-+]?{UNSIGNED}"
_QUANTITY = re.compile(rf"({NUMBER})\s*([^\s\d.].*)?")


def read_quantity(text: str, unit: str) -> float | None:
    """Return the number that a text such as `200 g` states in this unit; None if it states none."""
    text = text.strip()
    found = _QUANTITY.fullmatch(text.replace(",", ".", 1) if re.fullmatch(r"[-+]?\d+,\d+\D*", text) else text)
    if found is None:
        return None
    measured, size = (unit, 1.0) if found[2] in (None, unit) else OTHER_UNITS.get(found[2], (None, 1.0))
    return float(found[1]) * size if measured == unit else None
