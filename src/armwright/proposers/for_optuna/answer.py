"""A model's answer for an Optuna study: its JSON schema, and its values read and checked."""

from collections.abc import Mapping, Sequence
from typing import Any, cast

from optuna.distributions import CategoricalDistribution, IntDistribution

from armwright.exceptions import DesignError
from armwright.llm.answer import answer_json, object_schema, response_schema, short_reason
from armwright.llm.model_options import PromptOptions
from armwright.proposers.for_optuna.parameter_values import choice_texts, json_value, read_value
from armwright.proposers.for_optuna.parameters import Parameter, unknown_parameter

OTHER_KEYS = ("parameters", "reasoning", "reason")  # keys of an answer that are no parameters
MAX_ERRORS = 10  # reported at once
LEFT_OUT = ("", "null", "none", "n/a", "-")  # values that models write for conditional parameters they leave out


def answer_schema(parameters: Sequence[Parameter], options: PromptOptions) -> dict[str, Any]:
    """Return the JSON schema of an answer: the parameters, of which conditional ones are optional, and the reason."""
    fields = {parameter.key: _property(parameter) for parameter in parameters}
    required = [parameter.key for parameter in parameters if not parameter.conditional]
    return response_schema("NewTrial", {"parameters": object_schema(fields, required)}, "these parameters", options)


def read_answer(content: Mapping[str, Any], parameters: Sequence[Parameter]) -> tuple[dict[str, Any], str]:
    """Return the parameters of an answer, by name, and the reason for them.

    Raises:
        DesignError: Values are missing or invalid; the message lists all of them.
    """
    given, unknown = _by_name(content, parameters)
    errors = [str(unknown_parameter(key, [p.key for p in parameters])) for key in unknown]
    params: dict[str, Any] = {}
    for parameter in parameters:
        value = given.get(parameter.name)
        error = f"{parameter.key} is missing: {parameter.description}"
        if parameter.name in given:
            try:
                params[parameter.name] = read_value(parameter.key, value, parameter.distribution)
                continue
            except DesignError as invalid:
                error = str(invalid)
        left_out = value is None or (isinstance(value, str) and value.strip().casefold() in LEFT_OUT)
        if not (parameter.conditional and left_out):
            errors.append(error)
    if not params and not errors:
        errors = ["no parameter is given"]
    if errors:
        raise DesignError("; ".join(errors[:MAX_ERRORS]))
    return params, short_reason(content.get("reason"))


def written_answer(params: Mapping[str, Any], reason: str, parameters: Sequence[Parameter], reasoning: str = "") -> str:
    """Return an answer as JSON, which `read_answer` reads without loss."""
    values = {p.key: json_value(params[p.name], p.distribution) for p in parameters if p.name in params}
    return answer_json({"parameters": values, "reason": reason}, reasoning)


def _property(parameter: Parameter) -> dict[str, Any]:
    """Return the schema of a value. Ranges are described but not enforced: a refusal can say what is wrong."""
    distribution = parameter.distribution
    name = {} if parameter.key == parameter.name else {"description": parameter.name}
    if isinstance(distribution, CategoricalDistribution):
        return {"type": "string", "enum": list(dict.fromkeys(choice_texts(distribution))), **name}
    kind = "integer" if isinstance(distribution, IntDistribution) else "number"
    return {"type": kind, "description": ": ".join([*name.values(), parameter.description])}


def _by_name(content: Mapping[str, Any], parameters: Sequence[Parameter]) -> tuple[dict[str, Any], list[str]]:
    """Return an answer's values by parameter name, and its unknown keys.

    Models may leave out the object around the parameters, and write names in another case.
    """
    inner = content.get("parameters")
    given = cast("dict[str, Any]", inner) if isinstance(inner, dict) else content
    names = {key.casefold(): p.name for p in parameters for key in (p.key, p.name)}
    names |= {key: p.name for p in parameters for key in (p.name, p.key)}
    values: dict[str, Any] = {}
    unknown: list[str] = []
    for key, value in given.items():
        name = names.get(key) or names.get(key.strip().casefold())
        if name is not None:
            values[name] = value
        elif given is not content or key not in OTHER_KEYS:
            unknown.append(key)
    return values, unknown
