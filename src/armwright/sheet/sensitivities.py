"""What changes if a link of a design is longer, its tube stiffer, or an actuator stronger.

Each changed design is evaluated like any other, with the postures that suit it best.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from armwright.arrays import Array, finite_or_none
from armwright.exceptions import SettingsError
from armwright.kinematics.arms.arm_arrays import stack_arms
from armwright.problem.evaluation import Evaluation
from armwright.problem.objectives import backlash_error, deflection, mass, worst_error
from armwright.problem.problem import Problem
from armwright.proof.perturbations import ROUNDING
from armwright.sheet.record import Sensitivity
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.parameters import CategoricalParameter, Design, FloatParameter, Parameter

LONGER = 0.01  # [m]
ACTUATOR = "actuator"
# Comparative, superlative, name of the part, and what a space may lack.
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
    is_priced: bool = True  # whether the price of what is changed is known


def _price(evaluation: Evaluation) -> Array:
    """Return the (R,) prices of arms [USD]; NaN where one is not stated."""
    drives = evaluation.arms.actuation
    return (0.0 if drives is None else drives.price) + evaluation.arms.structure_price


MEASURES: Sequence[Callable[[Evaluation], Array]] = (worst_error, deflection, backlash_error, mass, _price)


def sensitivities(problem: Problem, design: Design) -> tuple[Sensitivity, ...]:
    """Return what changes of a design change, in the first case of the task."""
    found = list(variations(problem.space, design))
    possible = [variation for variation in found if not variation.impossible]
    designs = [design, *(varied(problem.space, design, variation) for variation in possible)]
    evaluation = problem.physics(stack_arms([problem.arm(each) for each in designs]))
    changes = [_changes(measure, evaluation) for measure in MEASURES]
    violations = problem.violations(evaluation)
    lines: list[Sensitivity] = []
    row = 0
    for variation in found:
        if variation.impossible:
            lines.append(Sensitivity(variation.part, variation.change, variation.impossible))
            continue
        row += 1
        error, sag, play, mass, price = (finite_or_none(column[row]) for column in changes)
        broken = (violations[row] > ROUNDING) & (violations[0] <= ROUNDING)
        line = Sensitivity(
            part=variation.part,
            change=variation.change,
            position_error=error,
            deflection=sag,
            backlash_error=play,
            mass=mass,
            price=price if variation.is_priced else None,
            broken=tuple(c.description for c, one in zip(problem.constraints, broken, strict=True) if one),
        )
        lines.append(line)
    return tuple(lines)


def varied(space: DesignSpace, design: Design, variation: Variation) -> Design:
    """Return a design with a change; tied parameters follow."""
    return space.from_free_values({**space.free_values(design), **variation.params})


def variations(space: DesignSpace, design: Design) -> Iterator[Variation]:
    """Yield the changes of each link, tube and actuator of a design."""
    parameters = {parameter.name: parameter for parameter in space.parameters}
    free = space.free_values(design)
    material = space.link_section.material
    has_price = material is not None and material.price_per_kg > 0.0
    links = [
        _longer(name, float(free[name]), parameters[name], _part(space, design, name, "link"))
        for name in _of_kind(free, "link")
    ]
    tubes = _next(space, design, parameters, "tube", _tube_order(space))
    yield from (replace(variation, is_priced=has_price) for variation in (*links, *tubes))
    yield from _next(space, design, parameters, "motor", _motor_order(space))


def _changes(measure: Callable[[Evaluation], Array], evaluation: Evaluation) -> Array:
    """Return (R,) a quantity less that of the first arm; NaN if it is not known."""
    try:
        values = measure(evaluation)
    except SettingsError:
        return np.full(len(evaluation), np.nan)
    return values - values[0]


def _of_kind(free: Mapping[str, float | str], kind: str) -> list[str]:
    return [name for name in free if name == kind or name.rpartition("_")[0] == kind]


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


def _longer(name: str, length: float, parameter: Parameter, part: str) -> Variation:
    change = f"{1e3 * LONGER:+g} mm"
    assert isinstance(parameter, FloatParameter)
    if length + LONGER > parameter.high:
        reason = f"the space allows at most {1e3 * parameter.high:.4g} mm, it has {1e3 * length:.1f} mm"
        return Variation(part, change, impossible=reason)
    return Variation(part, change, {name: length + LONGER})


def _next(
    space: DesignSpace,
    design: Design,
    parameters: Mapping[str, Parameter],
    kind: str,
    order: Sequence[tuple[float, str]],
) -> Iterator[Variation]:
    """Yield the next choice of each tube or actuator; order: strength and name of the choices."""
    word, most, title, what = WORDS[kind]
    free = space.free_values(design)
    names = _of_kind(free, kind)
    if not names:
        stated = "no" if not order else "one"
        yield Variation(f"each {title}", f"next {word}", impossible=f"the space names {stated} {what}")
    for name in names:
        parameter, own, part = parameters[name], str(free[name]), _part(space, design, name, title)
        assert isinstance(parameter, CategoricalParameter)
        strength = {choice: value for value, choice in order}
        stronger = [
            choice for value, choice in order if choice in parameter.choices and value > strength.get(own, np.inf)
        ]
        if stronger:
            yield Variation(part, f"{own} → {stronger[0]}", {name: stronger[0]})
        else:
            reason = f"{own} is the {most} of the space"
            yield Variation(part, f"next {word}", impossible=reason)


def _tube_order(space: DesignSpace) -> list[tuple[float, str]]:
    tubes = space.link_section.options
    return sorted((tube.bending_stiffness, tube.name) for tube in tubes if tube.bending_stiffness is not None)


def _motor_order(space: DesignSpace) -> list[tuple[float, str]]:
    return sorted((actuator.peak_torque, actuator.name) for actuator in space.arm_actuators)
