"""What the page says first about a run: the designs to build, or why there is none."""

from collections.abc import Mapping, Sequence
from typing import Any

from armwright.problem.facts import ASKED, Facts
from armwright.problem.objectives import QUANTITIES
from armwright.proof.design_record import DesignRecord
from armwright.proof.infeasibility import describe_infeasibility
from armwright.runs.history import History


def recommended_designs(
    recommended: Sequence[Mapping[str, Any]], records: Mapping[int, DesignRecord]
) -> list[dict[str, Any]]:
    """Return the recommended designs, each once.

    Args:
        recommended: The recommendations of a summary, several of which may be of one design.
        records: The records of these designs by number.

    Returns:
        design, status and survival as in the summary; roles: all its roles; facts: what an engineer asks; loads: what
        its joints do along the cycle, None if that is not known.
    """
    found: list[dict[str, Any]] = []
    for number in dict.fromkeys(one["design"] for one in recommended):
        entries, record = [one for one in recommended if one["design"] == number], records[number]
        found.append(
            {
                "design": number,
                "roles": [one["role"] for one in entries],
                "status": entries[0]["status"],
                "survival": entries[0]["survival"],
                "facts": shown(record.facts),
                "loads": None if record.loads is None else record.loads.model_dump(),
            }
        )
    return found


def shown(facts: Facts) -> dict[str, dict[str, Any]]:
    """Return what an engineer asks of an arm, as far as it is known: value and text by quantity."""
    asked = {name: facts[name] for name in ASKED if name in facts}
    return {name: {"value": fact.value, "text": fact.text} for name, fact in asked.items() if fact.value is not None}


def explained(facts: Sequence[Facts]) -> dict[str, dict[str, str]]:
    """Return label, unit and description by name of each quantity that may be shown; facts: of some arms."""
    asked = {name: fact for each in facts for name, fact in each.items() if name in ASKED}
    return {
        name: {"label": one.label, "unit": one.unit, "description": one.explanation}
        for name, one in {**QUANTITIES, **asked}.items()
    }


def why_nothing(history: History, summary: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """Return why no design of a run with constraints is feasible, and the nearest one; None if one is feasible."""
    if not history.problem.constraints or not len(history) or history.feasible.any():
        return None
    (number,) = history.nearest(1)
    return {"nearest": number, "description": describe_infeasibility(history, (summary or {}).get("feasibility"))}
