"""Peak and mean current of a design, in records and texts."""

from dataclasses import dataclass

import numpy as np

from armwright.exceptions import SettingsError
from armwright.problem.evaluation import Evaluation


@dataclass(frozen=True)
class Supply:
    """What the drives of an arm draw along its cycle.

    Attributes:
        peak_current: The largest current [A].
        mean_current: The mean current, dwells included [A].
        voltage: The voltage of the supply [V]; None if the drives have several.
    """

    peak_current: float
    mean_current: float
    voltage: float | None

    @property
    def description(self) -> str:
        """The currents on one line."""
        voltage = "at several voltages" if self.voltage is None else f"at {self.voltage:g} V"
        return f"{self.peak_current:.3g} A peak, {self.mean_current:.3g} A mean, {voltage}"


def supply_of(evaluation: Evaluation, row: int) -> Supply | None:
    """Return what arm `row` of an evaluation draws; None without a cycle, or if its drives or durations are unknown."""
    drives = evaluation.arms.actuation
    if drives is None or evaluation.cycle_paths is None:
        return None
    try:
        currents = evaluation.supply
    except SettingsError:
        return None
    if currents is None or np.isnan(currents.peak[row]):
        return None
    voltages = np.unique(drives.voltage[row][drives.voltage[row] > 0.0])
    voltage = float(voltages[0]) if len(voltages) == 1 else None
    return Supply(float(currents.peak[row]), float(currents.mean[row]), voltage)
