"""Selection of designs of a front: by conditions, by one quantity, or the knee."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic_core import to_jsonable_python

from armwright.exceptions import FailureError, SettingsError, did_you_mean
from armwright.problem.conditions import Condition
from armwright.problem.facts import Facts
from armwright.problem.objectives import QUANTITIES
from armwright.proof.design_record import (
    DesignRecord,
    bounded_numbers,
    compute_facts,
    facts_by_number,
    read_records,
)
from armwright.proof.infeasibility import describe_infeasibility
from armwright.proof.perturbations import evaluate_survival
from armwright.proof.ranking import knee_first
from armwright.proof.results import read_summary
from armwright.runs.folder import read_run
from armwright.runs.history import FrontMember, History
from armwright.spaces.parameters import FloatParameter

# Names by which users look for quantities that are called otherwise
_SYNONYMS = {"n_joints": "joints", "joint_count": "joints", "cost": "price", "weight": "mass", "reach": "length"}


def numbers_of(history: History, member: FrontMember) -> dict[str, float]:
    """Return the quantities to select by: real parameters, length and mass, bounded quantities, objectives."""
    space = history.problem.space
    reals = {
        p.name: float(member.design.params.get(p.name, 0.0)) for p in space.parameters if isinstance(p, FloatParameter)
    }
    arm = {"length": member.arm.length, "mass": member.arm.mass}
    objectives = {o.name: value for o, value in zip(history.problem.objectives, member.values, strict=True)}
    return {**reals, **arm, **bounded_numbers(history, member.number), **objectives}


def pick(
    history: History,
    where: Sequence[Condition] = (),
    by: str | None = None,
    numbers: Sequence[int] | None = None,
    facts: Mapping[int, Facts] | None = None,
) -> list[FrontMember]:
    """Select the designs of the front that satisfy all conditions, the best first.

    Without `by`, the knee of the front comes first, then the designs nearest to its corner.

    Args:
        history: The trials.
        where: Conditions. Quantities that the run did not evaluate are evaluated now, in the task's first case.
        by: The quantity to sort by, smallest first; largest first if more of it is better, as of `reserve`.
        numbers: The trials to select from, such as those that hold; None for all.
        facts: What is known of the designs by number; None to compute it if needed.

    Raises:
        FailureError: No design satisfies the conditions.
        SettingsError: A quantity does not exist.

    Examples:
        >>> import armwright as aw
        >>> run = aw.optimize(aw.Problem(aw.load_task("target-1")), proposer="rules", n_total=20)
        >>> lightest = pick(run.history, [Condition("length", "<=", 1.2)], by="torque")[0]
        >>> lightest.values[1] == min(member.values[1] for member in run.front if member.arm.length <= 1.2)
        True
    """
    if len(history) and not history.front:
        raise FailureError(describe_infeasibility(history))
    asked = [*(condition.name for condition in where), *([] if by is None else [by])]
    quantities = quantities_of_front(history, asked, facts)
    reals = (p for p in history.problem.space.parameters if isinstance(p, FloatParameter))
    units = {one.name: one.unit for one in (*QUANTITIES.values(), *reals, *history.problem.objectives)}
    where = [condition.in_unit(units[condition.name]) for condition in where]
    left = [
        member
        for member in history.front
        if all(condition.holds(quantities[member.number]) for condition in where)
        and (numbers is None or member.number in numbers)
    ]
    if not left:
        raise FailureError(_describe_unmet(where, list(quantities.values())))
    if by is not None:
        sign = -1.0 if by in QUANTITIES and QUANTITIES[by].more_is_better else 1.0
        return sorted(left, key=lambda member: sign * quantities[member.number][by])
    return knee_first(history, left)


def pick_from(
    run: Path,
    where: Sequence[Condition] = (),
    by: str | None = None,
    holds: bool = False,
) -> tuple[History, list[FrontMember], dict[int, DesignRecord]]:
    """Select designs of a run folder; return history, designs, and the records of the front by number.

    holds: only designs that hold under perturbations; without constraints, robust ones.
    """
    _, history = read_run(run)
    numbers = None
    if holds and history.front:
        verification = (read_summary(run) or {}).get("verification")
        if verification is None:
            raise FailureError(f"{run} was made without a verification (verify=False), which --holds needs")
        numbers = verification["verdict"]["numbers"]
    records = read_records(run, history, [member.number for member in history.front])
    return history, pick(history, where, by, numbers, facts_by_number(records)), records


def survival_of(run: Path, history: History, numbers: Sequence[int]) -> dict[int, dict[str, Any]]:
    """Return records of the survival of designs of a run by number, as in its summary; empty without constraints.

    Those of recommended designs are read; of the others, assumed values are changed now.
    """
    recommended = (read_summary(run) or {}).get("recommended", ())
    stored = {one["design"]: one["survival"] for one in recommended if one["survival"] is not None}
    missing = [number for number in numbers if number not in stored]
    records = read_records(run, history, missing)
    known = {number: one.survival for number, one in records.items() if one.survival is not None}
    evaluated: dict[int, dict[str, Any]] = {
        number: to_jsonable_python(one) for number, one in evaluate_survival(history, missing, known).items()
    }
    return {number: one for number, one in {**stored, **evaluated}.items() if number in numbers}


def quantities_of_front(
    history: History, names: Sequence[str], facts: Mapping[int, Facts] | None = None
) -> dict[int, dict[str, float]]:
    """Return the quantities of the designs of the front by number: those of `numbers_of`, and `names`.

    Raises:
        SettingsError: A name is unknown, or the quantity of a design.
    """
    quantities = {member.number: numbers_of(history, member) for member in history.front}
    known = list(quantities[history.front[0].number]) if history.front else []
    for name in dict.fromkeys(names):
        _check_name(name, list(dict.fromkeys([*known, *QUANTITIES])))
        if name not in known and quantities:
            facts = compute_facts(history, list(quantities)) if facts is None else facts
            for number, numbers in quantities.items():
                numbers[name] = _value(name, facts[number])
    return quantities


def _value(name: str, facts: Facts) -> float:
    """Return the value of a fact; SettingsError with those that are known if it is not."""
    value = facts[name].value
    if value is None:
        known = [other for other, fact in facts.items() if fact.value is not None and other in QUANTITIES]
        raise SettingsError(f"{name} is not known: {facts[name].reason}; known: {', '.join(known)}")
    return value


def _check_name(name: str, known: Sequence[str]) -> None:
    """Raise SettingsError if a name is unknown; the message lists the known ones."""
    if name not in known:
        synonym = _SYNONYMS.get(name)
        hint = f' Did you mean "{synonym}"?' if synonym in known else did_you_mean(name, known)
        raise SettingsError(f'unknown quantity "{name}".{hint} Available: {", ".join(known)}')


def _describe_unmet(where: Sequence[Condition], quantities: Sequence[Mapping[str, float]]) -> str:
    """Describe the first condition that no design meets, and the nearest value."""
    for condition in where:
        if not any(condition.holds(numbers) for numbers in quantities):
            values = [numbers[condition.name] for numbers in quantities]
            nearest = min(values) if condition.relation in ("<", "<=") else max(values)
            bound = f"{condition.name} {condition.relation} {condition.bound:g}"
            return f"no design of the front has {bound}; the nearest has {nearest:.4g}"
    return "no design of the front meets all of these conditions at once" if where else "no design is left to choose"
