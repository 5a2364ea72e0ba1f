"""Prompts for a language model, rendered from the templates in templates/."""

import re
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, TypeVar

from jinja2 import Environment, PackageLoader, StrictUndefined

from armwright.llm.feedback import Feedback
from armwright.llm.model_options import PromptOptions
from armwright.llm.prompt_values import Limits, common_values, shown_values
from armwright.problem.problem import Problem
from armwright.runs.history import History
from armwright.spaces.parameters import exact
from armwright.text import end_of, fence, without_thoughts

MAX_TOKENS = 12_000  # longer prompts show fewer designs and targets
MAX_ANALYSIS_LENGTH = 40_000  # characters from the end of a free answer that the second call reads
DEFAULTS = PromptOptions()

T = TypeVar("T")


def design_prompt(history: History, seed: int, options: PromptOptions = DEFAULTS, *, name: str = "llm") -> str:
    """Return the prompt for the next design.

    Fewer designs, then fewer targets are shown until the prompt has at most about MAX_TOKENS, unless the template
    itself is longer. The seed draws the designs that are shown; those of the proposer `name` are marked as its own.
    """
    feedback = Feedback(history, seed, name)
    common = common_values(history, options)
    return shortened(
        lambda most: rendered(f"{options.prompt}.md.j2", {**common, **shown_values(history, feedback, most)}),
        Limits(),
        Limits.fewer,
    )


def parameters_prompt(problem: Problem, answer: str) -> str:
    """Return the prompt of the second call, which extracts the parameters from a free answer."""
    return rendered("parameters.md.j2", {"parameters": problem.space.parameters, **fenced(answer)})


def shortened(render: Callable[[T], str], most: T, fewer: Callable[[T], T]) -> str:
    """Return a prompt of at most about MAX_TOKENS, or the shortest one.

    It shows `most`, or what `fewer` makes of it: the next smaller limits, or the same if they are the smallest.
    """
    while True:
        text, less = render(most), fewer(most)
        if estimated_tokens(text) <= MAX_TOKENS or less == most:
            return text
        most = less


def fenced(answer: str) -> dict[str, str]:
    """Return the end of a free answer, without its thoughts, and a fence that does not occur in it."""
    material = end_of(without_thoughts(answer).strip() or answer, MAX_ANALYSIS_LENGTH)
    return {"answer": material, "fence": fence(material)}


def rendered(name: str, values: Mapping[str, Any]) -> str:
    """Render a template, without blanks at line ends and repeated empty lines."""
    text = _environment().get_template(name).render(values)
    return re.sub(r"\n{3,}", "\n\n", "\n".join(line.rstrip(" \t") for line in text.split("\n"))).strip() + "\n"


def estimated_tokens(text: str) -> int:
    """Estimate the tokens of a text: one per 5 letters of a word, or 3 digits of a number."""
    return len(re.findall(r"[0-9]{1,3}|[A-Za-z]{1,5}|\S", text))


@cache
def _environment() -> Environment:
    """Return the environment of the templates; prompts are not HTML, so nothing is escaped."""
    loader = PackageLoader("armwright.llm")
    environment = Environment(loader=loader, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters["exact"] = exact
    return environment
