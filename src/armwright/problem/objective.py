"""An objective: a number for each target, made from an evaluation, and how these become one."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import UnknownQuantityError
from armwright.kinematics.arms.actuation import Actuation
from armwright.kinematics.arms.arm_arrays import ArmArrays
from armwright.kinematics.cycle.cycle_loads import check_durations
from armwright.problem.evaluation import Evaluation
from armwright.problem.scene import Scene
from armwright.robot.actuators import UNITS

# What a quantity depends on: `motions` if the worst of targets and motions counts, `durations` of the steps of a cycle
Need = Literal[
    "orientation", "clearance", "motions", "cycle", "durations", "workspace", "directions", "sections", "masses"
]  # fmt: skip
Over = Literal["sum", "max", "min", "rms", "arm"]
_OVER: Mapping[Over, str] = {
    "sum": " Summed over the targets.",
    "max": " The worst target counts.",
    "min": " The target where it is smallest counts.",
    "rms": " The root mean square over the targets.",
    "arm": "",
}
STOPPED = "not evaluated, since the arm misses a target or a line by far, or its path jumps"
KEYS = {  # of ratings in records
    "peak": "peak_torque", "continuous": "rated_torque", "no_load_speed": "speed", "coulomb": "coulomb_friction",
}  # fmt: skip


@dataclass(frozen=True)
class Objective:
    """A quantity per arm to minimise."""

    name: str
    unit: str
    description: str  # the quantity at one target, or for `over="arm"` of the arm, for readers new to this program
    each: Callable[[Evaluation], Array]  # its value per target, (N, T); for `over="arm"` of the arm itself, (N,)
    over: Over = "sum"  # how the values become one: their sum, maximum, minimum or root mean square
    label: str = ""  # in tables and figures; by default the name in words
    symbol: str = ""  # in formulas and prompts; by default E_name
    # What of the value an objective minimises, if not all: of errors, what exceeds the stated tolerances
    excess: Callable[[Evaluation], Array] | None = None
    needs: tuple[Need, ...] = ()
    ratings: tuple[str, ...] = ()  # of `Actuation` that every actuator has to state
    more_is_better: bool = False  # objectives minimise what is less then, so it is only bounded

    def __post_init__(self) -> None:
        object.__setattr__(self, "label", self.label or self.name.replace("_", " ").capitalize())
        object.__setattr__(self, "symbol", self.symbol or f"E_{self.name}")

    def __call__(self, evaluation: Evaluation) -> Array:
        """Return one value per arm, (N,), as constraints bound it."""
        self.check(evaluation, evaluation.arms)
        return self._total(self.each(evaluation))

    def minimised(self, evaluation: Evaluation) -> Array:
        """Return one value per arm, (N,), as searches minimise it."""
        return self._total(self.shares(evaluation))

    def known(self, evaluation: Evaluation, minimised: bool = False) -> tuple[Array, str]:
        """Return (N,) values and an empty reason; NaN and the reason if task or arms leave the quantity open.

        What is not known of one arm is not known of any. `minimised`: return the value that searches minimise.
        """
        try:
            values = self.minimised(evaluation) if minimised else self(evaluation)
        except UnknownQuantityError as unknown:
            return np.full(len(evaluation), np.nan), unknown.reason
        finite = np.isfinite(values)
        reason = STOPPED if evaluation.is_stopped.any() else "it is not finite"
        return np.where(finite, values, np.nan), "" if finite.all() else reason

    def shares(self, evaluation: Evaluation) -> Array:
        """Return the shares of the targets in the minimised value, (N, T); for `over="arm"` the value itself, (N,)."""
        self.check(evaluation, evaluation.arms)
        return (self.excess or self.each)(evaluation)

    def check(self, scene: Scene, arms: ArmArrays) -> None:
        """Raise UnknownQuantityError if the task or the arms lack what the quantity needs."""
        if self.ratings:
            self._check_ratings(arms.actuation)
        if "sections" in self.needs and np.isnan([arms.bending_stiffness, arms.torsional_stiffness]).any():
            raise UnknownQuantityError(
                f"objective {self.name} needs the section and the material of the links; try link_section: "
                "{tubes: [[0.03, 0.002]], material: aluminium} in the space file",
                "no section and material of the links are stated",
            )
        if "masses" in self.needs and arms.no_mass is not None:
            reason = str(max(arms.no_mass))
            raise UnknownQuantityError(f"objective {self.name} needs the masses of all links, but {reason}", reason)
        for need in self.needs:
            scene.require(need)
        if "durations" in self.needs and scene.plan is not None:
            check_durations(arms.actuation, scene.plan)

    def _check_ratings(self, actuation: Actuation | None) -> None:
        if actuation is None:
            raise UnknownQuantityError(
                f"objective {self.name} needs actuators: name some in the space file (actuators: [...])",
                "no actuators are named",
            )
        for rating in self.ratings:
            if np.isnan(getattr(actuation, rating)).any():
                key = KEYS.get(rating, rating)
                raise UnknownQuantityError(
                    f"objective {self.name} needs the {key} of every actuator; try {key} [{UNITS[key]}] in the record "
                    "of each in the space file, or leave out those without",
                    f"the {key.replace('_', ' ')} of an actuator is not known",
                )

    def _total(self, each: Array) -> Array:
        match self.over:
            case "sum":
                return each.sum(axis=1)
            case "max":
                return each.max(axis=1)
            case "min":
                return each.min(axis=1)
            case "rms":
                return np.sqrt(np.mean(each**2, axis=1))
            case "arm":
                return each

    @property
    def explanation(self) -> str:
        """The quantity and how the targets count, in sentences."""
        return f"{self.description[0].upper()}{self.description[1:]}.{_OVER[self.over]}"

    @property
    def unit_in_brackets(self) -> str:
        """Its unit behind a name: ` [m]`; empty if it has none."""
        return f" [{self.unit}]" if self.unit else ""

    @property
    def is_of_targets(self) -> bool:
        """True if each target contributes to it."""
        return self.over != "arm"


QUANTITIES: dict[str, Objective] = {}  # all that are built in, by name


def quantity(
    unit: str,
    over: Over = "sum",
    *,
    needs: tuple[Need, ...] = (),
    ratings: tuple[str, ...] = (),
    symbol: str = "",
    label: str = "",
    excess: Callable[[Evaluation], Array] | None = None,
    more_is_better: bool = False,
) -> Callable[[Callable[[Evaluation], Array]], Objective]:
    """Make an objective of the function of its values, with the name and the docstring of that function.

    It is then one of QUANTITIES.
    """

    def decorated(each: Callable[[Evaluation], Array]) -> Objective:
        text = " ".join((each.__doc__ or "").split()).rstrip(".")
        description = text[:1].lower() + text[1:]
        name = each.__name__
        own = Objective(name, unit, description, each, over, label, symbol, excess, needs, ratings, more_is_better)
        QUANTITIES[name] = own
        return own

    return decorated
