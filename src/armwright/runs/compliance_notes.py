"""How far the tip of a design yields, and what it can hold, in sentences for its build sheet."""

from collections.abc import Iterator

import numpy as np

from armwright.exceptions import SettingsError
from armwright.kinematics.payload_limits import payloads_over_reach
from armwright.problem.evaluation import Evaluation
from armwright.problem.objective import Objective
from armwright.problem.objectives import BACKLASH_ERROR, DEFLECTION, PAYLOAD_CAPACITY, PAYLOAD_DEFLECTION
from armwright.robot.arm import Arm
from armwright.tasks.moments import MAX_MASS

FRACTIONS = (0.5, 1.0)  # of the reach


def compliance_notes(arm: Arm, evaluation: Evaluation) -> Iterator[str]:
    """Yield what is known of an arm, the only one of an evaluation; nothing without actuators."""
    if (by_weight := _known(DEFLECTION, evaluation)) is not None:
        by_payload = _known(PAYLOAD_DEFLECTION, evaluation) or 0.0
        alone = f", {1e3 * by_payload:.2f} mm by the payload alone" if by_payload else ""
        yield f"The weight of arm and load moves the tip by {1e3 * by_weight:.2f} mm at most at the targets{alone}."
    if (play := _known(BACKLASH_ERROR, evaluation)) is not None:
        yield f"Backlash moves the tip by {1e3 * play:.2f} mm at most."
    capacity = _known(PAYLOAD_CAPACITY, evaluation)
    if capacity is not None and capacity < MAX_MASS:  # else no motor feels the payload
        yield f"The actuators hold {capacity:.3g} kg at all targets{_over_reach(arm)}."


def _over_reach(arm: Arm) -> str:
    found = payloads_over_reach(arm, FRACTIONS)
    held = [
        f"{_mass(payload)} at {fraction:.0%}"
        for fraction, payload in zip(FRACTIONS, found.payloads, strict=True)
        if not np.isnan(payload)
    ]
    return f", {' and '.join(held)} of the reach of {found.reach:.3g} m" if held else ""


def _mass(payload: float) -> str:
    return f"{payload:.3g} kg" if payload < MAX_MASS else "any payload"


def _known(quantity: Objective, evaluation: Evaluation) -> float | None:
    """Return a quantity of the arm; None if it needs what is not known of it."""
    try:
        return float(quantity(evaluation)[0])
    except SettingsError:
        return None
