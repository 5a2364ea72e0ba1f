"""What changes if a link of a design is longer, its tube stiffer, or an actuator stronger.

Each changed design is evaluated like any other, with the postures that suit it best.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from armwright.arrays import Array, finite_or_none
from armwright.exceptions import SettingsError
from armwright.kinematics.arms.arm_arrays import stack_arms
from armwright.problem.compliance_quantities import backlash_error, deflection
from armwright.problem.evaluation import Evaluation
from armwright.problem.objectives import mass, worst_error
from armwright.problem.problem import Problem
from armwright.proof.perturbations import ROUNDING
from armwright.sheet.record import Sensitivity
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.parameters import CategoricalParameter, Design, FloatParameter, Parameter

LONGER = 0.01  # [m]
ACTUATOR = "actuator"
# Of choices: comparative, superlative, name of the part, and what a space may lack.
WORDS = {
    "tube": ("stiffer", "stiffest", "tube", "tube of a known material"),
    "motor": ("larger", "largest", ACTUATOR, "actuator"),
}


@dataclass(frozen=True)
class Variation:
    """A change of a design."""

    part: str  # what is changed
    change: str  # how
    params: Mapping[str, float | str] = field(default_factory=dict[str, float | str])  # the changed parameters
    impossible: str = ""  # why it cannot be changed so; empty if it can


def _price(evaluation: Evaluation) -> Array:
    """Return the (R,) prices of arms [USD]; NaN where one is not stated."""
    drives = evaluation.arms.actuation
    return (0.0 if drives is None else drives.price) + evaluation.arms.structure_price


MEASURES: Mapping[str, Callable[[Evaluation], Array]] = {  # by field of `Sensitivity`
    "position_error": worst_error,
    "deflection": deflection,
    "backlash_error": backlash_error,
    "mass": mass,
    "price": _price,
}


def sensitivities(problem: Problem, design: Design) -> tuple[Sensitivity, ...]:
    """Return what changes of a design change, in the first case of the task."""
    found = list(variations(problem.space, design))
    possible = [variation for variation in found if not variation.impossible]
    designs = [design, *(varied(problem.space, design, variation) for variation in possible)]
    evaluation = problem.physics(stack_arms([problem.arm(each) for each in designs]))
    changes = {name: _changes(measure, evaluation)[1:] for name, measure in MEASURES.items()}
    violations = problem.violations(evaluation)
    broken = (violations[1:] > ROUNDING) & (violations[0] <= ROUNDING)
    if not _states_prices(problem.space):  # of links; those of actuators are the catalogue's
        changes["price"][[ACTUATOR not in variation.part for variation in possible]] = np.nan
    lines = iter(
        Sensitivity(
            part=variation.part,
            change=variation.change,
            impossible="",
            **{name: finite_or_none(column[row]) for name, column in changes.items()},
            broken=tuple(c.description for c, one in zip(problem.constraints, broken[row], strict=True) if one),
        )
        for row, variation in enumerate(possible)
    )
    return tuple(Sensitivity(v.part, v.change, v.impossible) if v.impossible else next(lines) for v in found)


def varied(space: DesignSpace, design: Design, variation: Variation) -> Design:
    """Return a design with a change; tied parameters follow."""
    return space.from_free_values({**space.free_values(design), **variation.params})


def variations(space: DesignSpace, design: Design) -> Iterator[Variation]:
    """Yield the changes of each link, tube and actuator of a design."""
    for name in _of_kind(space, design, "link"):
        part, parameter = _part(space, design, name, "link"), _parameter(space, name)
        length, change = float(space.free_values(design)[name]), f"{1e3 * LONGER:+g} mm"
        assert isinstance(parameter, FloatParameter)
        if length + LONGER <= parameter.high:
            yield Variation(part, change, {name: length + LONGER})
        else:
            reason = f"the space allows at most {1e3 * parameter.high:.4g} mm, it has {1e3 * length:.1f} mm"
            yield Variation(part, change, impossible=reason)
    stiffness = [(tube.bending_stiffness, tube.name) for tube in space.link_section.options]
    yield from _next(space, design, "tube", [(ei, name) for ei, name in stiffness if ei is not None])
    yield from _next(space, design, "motor", [(one.peak_torque, one.name) for one in space.arm_actuators])


def _next(space: DesignSpace, design: Design, kind: str, choices: Sequence[tuple[float, str]]) -> Iterator[Variation]:
    """Yield the next choice of each tube or actuator; choices: of the space, strength and name."""
    word, most, title, what = WORDS[kind]
    names = _of_kind(space, design, kind)
    if not names:
        stated = "one" if choices else "no"
        yield Variation(f"each {title}", f"next {word}", impossible=f"the space names {stated} {what}")
    strength = {name: value for value, name in choices}
    for name in names:
        parameter, own = _parameter(space, name), str(space.free_values(design)[name])
        part = _part(space, design, name, title)
        assert isinstance(parameter, CategoricalParameter)
        stronger = [
            (value, choice)
            for value, choice in choices
            if choice in parameter.choices and value > strength.get(own, np.inf)
        ]
        if stronger:
            yield Variation(part, f"{own} → {min(stronger)[1]}", {name: min(stronger)[1]})
        else:
            yield Variation(part, f"next {word}", impossible=f"{own} is the {most} of the space")


def _changes(measure: Callable[[Evaluation], Array], evaluation: Evaluation) -> Array:
    """Return (R,) a quantity less that of the first arm; NaN if it is not known."""
    try:
        values = measure(evaluation)
    except SettingsError:
        return np.full(len(evaluation), np.nan)
    return values - values[0]


def _states_prices(space: DesignSpace) -> bool:
    """Return whether the space states the price of its tubes."""
    material = space.link_section.material
    return material is not None and material.price_per_kg > 0.0


def _parameter(space: DesignSpace, name: str) -> Parameter:
    return next(parameter for parameter in space.parameters if parameter.name == name)


def _of_kind(space: DesignSpace, design: Design, kind: str) -> list[str]:
    """Return the free parameters KIND or KIND_1, KIND_2, … of a design."""
    return [name for name in space.free_values(design) if name == kind or name.rpartition("_")[0] == kind]


def _part(space: DesignSpace, design: Design, name: str, title: str) -> str:
    """Return what a parameter changes, with what is tied to it, by the numbers of the arm's joints: `link 1, 3`.

    A module of two joints has two actuators, and its link is after the second.
    """
    if "_" not in name:
        return f"{title} of all links"
    joints: dict[int, list[int]] = {}
    for number, module in enumerate(design.module_of_joint, start=1):
        joints.setdefault(module + 1, []).append(number)
    modules = [int(one.rpartition("_")[2]) for one in (name, *(tied for tied, other in space.tie if other == name))]
    changed = [joints[module] for module in modules if module in joints]
    numbers = [number for of_module in changed for number in (of_module if title == ACTUATOR else of_module[-1:])]
    return f"{title} {', '.join(map(str, numbers))}"
