"""Prompts for a language model, rendered from templates in templates/ or from a file."""

import os
import re
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import TemplateError, TemplateSyntaxError, meta, nodes

from armwright.exceptions import SettingsError, did_you_mean
from armwright.files import read_text
from armwright.llm.feedback import Feedback, proposal_records
from armwright.llm.model_options import PromptOptions
from armwright.llm.prompt_values import VARIABLES, Limits, common_values, shown_values
from armwright.llm.template_sandbox import Sandbox, render
from armwright.problem.problem import Problem
from armwright.runs.control import MAX_HINT_LENGTH
from armwright.runs.history import History
from armwright.text import end_of, fence, one_line, without_thoughts

PROMPTS = ("plus", "minus", "full")
VARIANTS = ("plus-reworded-1", "plus-reworded-2", "plus-reordered")  # of the experiment prompt-sensitivity
BUILTIN_PROMPTS = (*PROMPTS, *VARIANTS)

MAX_TOKENS = 12_000  # longer prompts show fewer designs, earlier proposals and targets
MAX_ANALYSIS_LENGTH = 40_000  # characters from the end of a free answer that the second call reads
MAX_TEMPLATE = 256 * 1024  # [bytes]
DEFAULTS = PromptOptions()


@dataclass(frozen=True)
class Prompt:
    """A prompt's name and its Jinja template.

    Raises:
        SettingsError: The template is invalid, or names unknown variables or templates.
    """

    name: str
    template: str

    def __post_init__(self) -> None:
        try:
            tree = _sandbox().parse(self.template)
            _sandbox().from_string(self.template)  # filters and tests, too
        except TemplateSyntaxError as error:
            raise SettingsError(f"prompt {self.name}, line {error.lineno}: {error.message}") from error
        except (RecursionError, SyntaxError) as error:  # SyntaxError: of the Python code that Jinja generates
            raise SettingsError(f"prompt {self.name} is nested too deeply") from error
        except ValueError as error:  # of Python, for a number of thousands of digits
            raise SettingsError(f"prompt {self.name} cannot be read: {str(error)[:80]}") from error
        known = {*VARIABLES, *_sandbox().globals, *_exported(tree)}
        for other in set(meta.find_referenced_templates(tree)) - {None}:
            templates = _sandbox().list_templates()
            if other not in templates:
                raise SettingsError(
                    f'prompt {self.name} uses the template "{other}", which does not exist.'
                    f"{did_you_mean(str(other), templates)} Templates: {', '.join(templates)}"
                )
            known |= _exported(_sandbox().parse(builtin_template(str(other))))
        for name in sorted(meta.find_undeclared_variables(tree) - known):
            raise SettingsError(
                f'prompt {self.name} uses "{name}", which does not exist.{did_you_mean(name, VARIABLES)} '
                f"Names: {', '.join(VARIABLES)}"
            )

    def render(
        self,
        history: History,
        seed: int,
        options: PromptOptions = DEFAULTS,
        *,
        name: str = "llm",
        hints: Sequence[str] = (),
    ) -> str:
        """Return the prompt for the next design.

        Fewer designs, then fewer targets are shown until the prompt has at most about MAX_TOKENS, unless hints and
        the template itself are longer.

        Args:
            history: the finished trials.
            seed: of the draw of the designs that are shown.
            options: memory, form of the answer and number of designs.
            name: name of the proposer, whose earlier proposals are shown if the memory is "own".
            hints: the user's notes; appended if the template ignores them.

        Raises:
            SettingsError: The template fails, or renders to nothing.
        """
        proposed = proposal_records(history, name) if options.expects else []
        feedback = Feedback(history, seed, name, options.others)
        common = common_values(history, options) | {
            "n_proposed": len(proposed),
            "hints": [line for hint in hints if (line := one_line(hint, MAX_HINT_LENGTH))],  # visible ones
        }
        most = Limits()
        while True:
            text = self._with_hints({**common, **shown_values(history, feedback, proposed, most)})
            if estimated_tokens(text) <= MAX_TOKENS or most == most.fewer():
                return text
            most = most.fewer()

    def _with_hints(self, values: Mapping[str, Any]) -> str:
        text = self._render(values)
        if not values["hints"] or text != self._render({**values, "hints": []}):
            return text
        return text + "\n" + rendered("hints.md.j2", values)

    def _render(self, values: Mapping[str, Any]) -> str:
        try:
            text = _tidy(render(_sandbox().from_string(self.template), values))
        except _TEMPLATE_ERRORS as error:
            lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == "<template>"]
            line = f", line {lines[-1]}" if lines else ""
            message = one_line(str(error), 300) or type(error).__name__
            raise SettingsError(f"prompt {self.name}{line} cannot be rendered: {message}") from error
        if not text.strip():
            raise SettingsError(f"prompt {self.name} is empty")
        return text


# Errors that a template can cause.
_TEMPLATE_ERRORS = (
    TemplateError, TypeError, ValueError, ArithmeticError, LookupError, AttributeError, NameError, RecursionError,
    MemoryError
)  # fmt: skip


def load_prompt(name: str | Path) -> Prompt:
    """Return a built-in prompt by its name, or that of a template file."""
    if str(name) in BUILTIN_PROMPTS:
        return _builtin_prompt(str(name))
    path = Path(name)
    if os.path.isdir(path):
        raise SettingsError(f"prompt {path} is a folder, not a template file")
    if not os.path.isfile(path):
        raise SettingsError(
            f'unknown prompt "{name}".{did_you_mean(str(name), PROMPTS)} Prompts: {", ".join(PROMPTS)}, or a file'
        )
    text = read_text(path, MAX_TEMPLATE, SettingsError)
    # A file called "plus" must not pass for the built-in prompt.
    return Prompt(path.name if path.name not in BUILTIN_PROMPTS else f"./{path.name}", text)


@cache
def _builtin_prompt(name: str) -> Prompt:
    return Prompt(name, builtin_template(f"{name}.md.j2" if name in PROMPTS else f"variants/{name}.md.j2"))


def builtin_template(name: str) -> str:
    """Return the text of a built-in template."""
    loader = _sandbox().loader
    assert loader is not None
    return loader.get_source(_sandbox(), name)[0]


def whole_template(name: str) -> str:
    """Return the template of a prompt as one text, with the template that built-in prompts extend."""
    template = load_prompt(name).template
    if name not in PROMPTS:
        return template
    own = dict(_blocks(template))
    between = "".join(text for name, text in _blocks(template) if not name)
    macros = between.partition('{% extends "proposal.md.j2" %}\n')[2].rstrip() + "\n"
    whole = "".join(own.get(name, text) if name else text for name, text in _blocks(builtin_template("proposal.md.j2")))
    return whole.replace("{% block role %}", macros.lstrip("\n") + "{% block role %}", 1)


def _blocks(template: str) -> list[tuple[str, str]]:
    """Return the blocks of a template with their names, and the texts between them with empty ones."""
    first, *others = re.split(r"{% block (\w+) %}\n", template)
    pieces = [("", first)]
    for name, text in zip(others[::2], others[1::2], strict=True):
        body, end, after = text.partition("{% endblock %}\n")
        pieces += [(name, f"{{% block {name} %}}\n{body}{end}"), ("", after)]
    return pieces


def parameters_prompt(problem: Problem, answer: str, options: PromptOptions = DEFAULTS) -> str:
    """Return the prompt of the second call, which extracts the parameters from a free answer."""
    values = {
        "parameters": problem.space.parameters,
        "symbols": " and ".join(objective.symbol for objective in problem.objectives),
        "proposals": options.proposals,
        "expected": options.expects,
        **fenced(answer),
    }
    return rendered("parameters.md.j2", values)


def fenced(answer: str) -> dict[str, str]:
    """Return the end of a free answer, without its thoughts, and a fence that does not occur in it."""
    material = end_of(without_thoughts(answer).strip() or answer, MAX_ANALYSIS_LENGTH)
    return {"answer": material, "fence": fence(material)}


def rendered(name: str, values: Mapping[str, Any]) -> str:
    """Render a built-in template."""
    return _tidy(render(_sandbox().get_template(name), values))


def estimated_tokens(text: str) -> int:
    """Estimate the tokens of a text: one per 5 letters of a word, or 3 digits of a number."""
    return len(re.findall(r"[0-9]{1,3}|[A-Za-z]{1,5}|\S", text))


def _tidy(text: str) -> str:
    """Remove blanks at line ends and repeated empty lines."""
    return re.sub(r"\n{3,}", "\n\n", "\n".join(line.rstrip(" \t") for line in text.split("\n"))).strip() + "\n"


def _exported(tree: nodes.Template) -> set[str]:
    """Return the macros and variables that a template defines for its blocks and its extensions."""
    macros = {node.name for node in tree.find_all(nodes.Macro)}
    return macros | {
        node.target.name for node in tree.body if isinstance(node, nodes.Assign) and isinstance(node.target, nodes.Name)
    }


@cache
def _sandbox() -> Sandbox:
    return Sandbox("armwright.llm")
