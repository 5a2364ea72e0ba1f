"""Quantities of arms: objectives, all minimised, and what constraints can bound besides."""

from collections.abc import Mapping, Sequence

from armwright.exceptions import SettingsError, did_you_mean
from armwright.problem import arm_quantities as arm
from armwright.problem import compliance_quantities as compliance
from armwright.problem import drive_quantities as drives
from armwright.problem.objective import QUANTITIES, Objective

MODULES = arm, compliance, drives  # that register quantities when they are imported
MAX_OBJECTIVES = 5  # the hypervolume of more takes long
PAPER_OBJECTIVES = (arm.position_error, arm.torque)
OBJECTIVES: Mapping[str, Objective] = {
    one.name: one
    for one in (*PAPER_OBJECTIVES, *QUANTITIES.values())
    if not one.more_is_better and one != drives.voltages  # a count that only a constraint makes sense of
}
# Who asks for more of these minimises what is less then.
MINIMISED: Mapping[str, Objective] = {
    "clearance": arm.clearance_shortfall, "dexterous_volume": arm.undexterous_fraction, "reserve": drives.limit_use,
}  # fmt: skip


def named_objectives(names: Sequence[str], others: Sequence[Objective] = ()) -> tuple[Objective, ...]:
    """Return the objectives of these names, built in or in `others`; SettingsError if unknown, repeated or too many."""
    known = {**MINIMISED, **{objective.name: objective for objective in others}, **OBJECTIVES}
    for name in names:
        if name not in known:
            raise SettingsError(
                f'unknown objective "{name}".{did_you_mean(name, known)} Objectives: {", ".join(known)}'
            )
    chosen = tuple(known[name] for name in names)
    if not 1 <= len(names) <= MAX_OBJECTIVES or len(set(chosen)) < len(names):
        raise SettingsError(
            f"objectives: expected 1 to {MAX_OBJECTIVES} different ones, got {', '.join(names) or 'none'}"
        )
    return chosen
