"""A model's answer turned into a trial's parameters: the schema it is asked for, and what is taken of what it gives."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

from armwright.exceptions import DesignError
from armwright.llm.answer import LONGEST_REASON, object_schema
from armwright.proposers.for_optuna.parameters import Parameter, read_value, unknown, value_schema, written_value
from armwright.proposers.for_optuna.prompt import Told
from armwright.text import one_line

AROUND = ("parameters", "reasoning", "reason", "expected")  # what an answer holds beside the values
MOST_REFUSALS = 10  # told at once
LEFT_OUT = ("", "null", "none", "n/a", "-")  # how models say that a conditional parameter plays no part


@dataclass(frozen=True)
class StudyAnswer:
    """Parameters by their names, why they were chosen, and the values that were expected (where that was asked)."""

    params: Mapping[str, Any]
    reason: str = ""
    expected: tuple[float, ...] | None = None


def answer_schema(
    parameters: Sequence[Parameter], objectives: Sequence[Told], *, reasoning: bool, expected: bool
) -> dict[str, Any]:
    """JSON schema of an answer: one property a parameter, and the reason.

    reasoning: whether the thoughts come first, in the same answer.
    expected: whether the expected values are asked for.
    """
    fields = {parameter.key: value_schema(parameter) for parameter in parameters}
    needed = [parameter.key for parameter in parameters if not parameter.conditional]
    content: dict[str, Any] = {"parameters": object_schema(fields, needed)}
    if reasoning:
        content = {"reasoning": {"type": "string", "description": "your analysis, step by step"}, **content}
    if expected:
        values = {o.key: {"type": "number", "description": f"that you expect; {o.direction}"} for o in objectives}
        content["expected"] = object_schema(values)
    content["reason"] = {"type": "string", "description": "the main reason for these parameters, in one sentence"}
    return {"title": "NewTrial", "description": "What to evaluate next.", **object_schema(content)}


def read_answer(content: Mapping[str, Any], parameters: Sequence[Parameter], objectives: Sequence[Told]) -> StudyAnswer:
    """The parameters of an answer; DesignError says all that is wrong with it."""
    given, unknowns = _by_name(content, parameters)
    refusals = [str(unknown(key, [p.key for p in parameters])) for key in unknowns]
    params: dict[str, Any] = {}
    for parameter in parameters:
        value = given.get(parameter.name)
        if parameter.name not in given or _is_left_out(value, parameter):
            if not parameter.conditional:
                refusals.append(f"{parameter.key} is missing: {parameter.words}")
            continue
        try:
            params[parameter.name] = read_value(parameter.key, value, parameter.distribution)
        except DesignError as refusal:
            refusals.append(str(refusal))
    if not params and not refusals:
        refusals = ["no parameter is given"]
    if refusals:
        raise DesignError("; ".join(refusals[:MOST_REFUSALS]))
    reason = one_line(str(content.get("reason") or ""), LONGEST_REASON)
    return StudyAnswer(params, reason, _expected(content.get("expected"), objectives))


def written_answer(
    answer: StudyAnswer, parameters: Sequence[Parameter], objectives: Sequence[Told], reasoning: str = ""
) -> str:
    """An answer as JSON that `read_answer` reads back to the same."""
    content: dict[str, Any] = {"reasoning": reasoning} if reasoning else {}
    content["parameters"] = {
        p.key: written_value(answer.params[p.name], p.distribution) for p in parameters if p.name in answer.params
    }
    if answer.expected is not None:
        content["expected"] = {o.key: value for o, value in zip(objectives, answer.expected, strict=True)}
    return json.dumps({**content, "reason": answer.reason}, ensure_ascii=False)


def _by_name(content: Mapping[str, Any], parameters: Sequence[Parameter]) -> tuple[dict[str, Any], list[str]]:
    """An answer's values by the parameters' names, and its keys that are none.

    Models leave out the object around the parameters, and take other letters.
    """
    inner = content.get("parameters")
    given = cast("dict[str, Any]", inner) if isinstance(inner, dict) else content
    among = {word.casefold(): p.name for p in parameters for word in (p.key, p.name)}
    among |= {word: p.name for p in parameters for word in (p.name, p.key)}
    found: dict[str, Any] = {}
    unknowns: list[str] = []
    for key, value in given.items():
        name = among.get(key) or among.get(key.strip().casefold())
        if name is not None:
            found[name] = value
        elif given is not content or key not in AROUND:
            unknowns.append(key)
    return found, unknowns


def _is_left_out(value: Any, parameter: Parameter) -> bool:
    """Whether a value says that its parameter plays no part; a choice of that name is a choice."""
    if not parameter.conditional:
        return False
    try:
        read_value(parameter.key, value, parameter.distribution)
    except DesignError:
        return value is None or (isinstance(value, str) and value.strip().casefold() in LEFT_OUT)
    return False


def _expected(given: Any, objectives: Sequence[Told]) -> tuple[float, ...] | None:
    """The expected values; None unless all are there."""
    if not isinstance(given, dict):
        return None
    values = cast("dict[str, Any]", given)
    numbers: list[float] = []
    for objective in objectives:
        try:
            number = float(values.get(objective.key, values.get(objective.name)))  # pyright: ignore[reportArgumentType]
        except (TypeError, ValueError, OverflowError):
            return None
        if not math.isfinite(number):
            return None
        numbers.append(number)
    return tuple(numbers)
