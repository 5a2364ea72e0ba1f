"""What the model is told: the problem, feedback on past designs, and how to think. The words are in templates/."""

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, Literal

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, create_model

from armwright.history import History
from armwright.kinematics.solve import UPDATES
from armwright.objectives import TORQUE_SCALE
from armwright.space import JOINT_WORDS, CategoricalParameter, Design, DesignSpace

PROMPTS = ("plus", "minus")
N_PARETO = 5  # members of the front shown, docs/method.md §6
N_RANDOM = 5  # other finished designs shown


def proposal_prompt(history: History, prompt: str, seed: int) -> str:
    """The prompt for the next design after `history`; which designs it shows is drawn from `seed`.

    prompt: "plus" with instructions on how to analyse the parameters, "minus" without.
    """
    front, others = _shown_designs(history, seed)
    return _render(
        "proposal.md.j2",
        problem=history.problem,
        space=history.problem.space,
        targets=_points(history.problem.task.points),
        joint_words=JOINT_WORDS,
        updates=UPDATES,
        torque_scale=TORQUE_SCALE,
        reference_point=history.reference_point,
        n_finished=len(history),
        n_front=len(history.front),
        front=_feedback(history, front),
        others=_feedback(history, others),
        plus=prompt == "plus",
    )


def parameters_prompt(space: DesignSpace, answer: str) -> str:
    """The prompt of the second call: the free answer turned into parameters."""
    return _render("parameters.md.j2", parameters=space.parameters, answer=answer)


@cache
def answer_schema(space: DesignSpace) -> type[BaseModel]:
    """The answer of the second call: one field a parameter, and the reason in one sentence.

    Ranges are told, not enforced here: the design space refuses in its own words.
    """
    fields: dict[str, Any] = {}
    for parameter in space.parameters:
        if isinstance(parameter, CategoricalParameter):
            fields[parameter.name] = (Literal[parameter.choices], Field())
        else:
            words = f"{parameter.low:g} <= {parameter.name} <= {parameter.high:g} {parameter.unit}"
            fields[parameter.name] = (float, Field(description=words, allow_inf_nan=False))
    fields["reason"] = (str, Field(default="", description="why this design, in one sentence"))
    return create_model(
        "NewDesign", __config__=ConfigDict(extra="forbid"), __doc__="The arm to evaluate next.", **fields
    )


def design_of(answer: BaseModel, space: DesignSpace) -> tuple[Design, str]:
    """The design of an answer, and its reason; DesignError where the space refuses it."""
    params = answer.model_dump()
    reason = " ".join(str(params.pop("reason")).split())
    return space.design(params), reason


def _shown_designs(history: History, seed: int) -> tuple[list[int], list[int]]:
    """Numbers of members of the front, and of other finished trials, drawn without repetition."""
    rng = np.random.default_rng(seed)
    front = [member.number for member in history.front]
    others = [trial.number for trial in history if trial.number not in set(front)]
    return _draw(front, N_PARETO, rng), _draw(others, N_RANDOM, rng)


def _draw(numbers: Sequence[int], n: int, rng: np.random.Generator) -> list[int]:
    if len(numbers) <= n:
        return list(numbers)
    return sorted(rng.choice(np.array(numbers), size=n, replace=False).tolist())


def _feedback(history: History, numbers: Sequence[int]) -> list[Mapping[str, Any]]:
    """For each design what docs/method.md §6 lists, as text."""
    if not numbers:
        return []
    evaluation = history.evaluation(numbers)
    each = np.stack([objective.each(evaluation) for objective in history.problem.objectives], axis=-1)  # (n, T, 2)
    shown: list[Mapping[str, Any]] = []
    for row, number in enumerate(numbers):
        trial = history.trials[number]
        shown.append(
            {
                "number": number,
                "origin": _row(trial.design.origin),
                "joints": "(" + ", ".join(trial.design.joints) + ")",
                "links": _row(trial.design.links),
                "e_each": _points(each[row]),
                "p_ik": _points(evaluation.reached[row]),
                "tau_ik": _points(evaluation.joint_torques[row], digits=4),
                "e_all": _row(trial.values),
            }
        )
    return shown


def _points(rows: NDArray[np.float64], digits: int = 3) -> str:
    return "[" + ", ".join(_row(row, digits) for row in rows) + "]"


def _row(values: Sequence[float] | NDArray[np.float64], digits: int = 3) -> str:
    # + 0.0 turns -0.0 into 0.0
    return "(" + ", ".join(f"{round(float(value), digits) + 0.0:.{digits}f}" for value in values) + ")"


def _render(template: str, **values: Any) -> str:
    return _environment().get_template(template).render(**values).strip() + "\n"


@cache
def _environment() -> Environment:
    # The output is a prompt, not a page: nothing is to be escaped.
    return Environment(
        loader=PackageLoader("armwright.llm"), undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
