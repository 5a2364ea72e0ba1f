"""Prompts for a language model: their templates (in templates/, or a file), rendered for a search."""

import os
import re
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal, get_args

from jinja2 import TemplateError, TemplateSyntaxError, meta, nodes

from armwright.exceptions import SettingsError, did_you_mean
from armwright.llm.feedback import Feedback, proposal_records
from armwright.llm.prompt_values import MOST_TARGETS, VARIABLES, common_values, shown_values
from armwright.llm.template_sandbox import Sandbox, render
from armwright.problem.problem import Problem
from armwright.runs.control import LONGEST_HINT
from armwright.runs.history import History
from armwright.text import end_of, fence, one_line, without_thoughts

PROMPTS = ("plus", "minus")
Memory = Literal["none", "own"]
MEMORIES: tuple[str, ...] = get_args(Memory)
Form = Literal["text", "then-schema", "schema"]  # of the answer: free; free, and a second call extracts it; by schema

MOST_TOKENS = 12_000  # of a prompt; beyond it fewer targets, designs and earlier proposals are shown
FEWEST_TARGETS = 4  # shown
MOST_PROPOSED, FEWEST_PROPOSED = 20, 4  # earlier proposals shown
LONGEST_ANALYSIS = 40_000  # characters of a free answer that the second call reads; the end counts
LARGEST_TEMPLATE = 256 * 1024  # [bytes]


@dataclass(frozen=True)
class Prompt:
    """A prompt's name and its Jinja template."""

    name: str
    template: str

    def __post_init__(self) -> None:
        """SettingsError where the template cannot be read."""
        try:
            tree = _sandbox().parse(self.template)
            _sandbox().from_string(self.template)  # filters and tests, too
        except TemplateSyntaxError as fault:
            raise SettingsError(f"prompt {self.name}, line {fault.lineno}: {fault.message}") from fault
        except (RecursionError, SyntaxError) as fault:  # the latter of the Python that jinja makes of it
            raise SettingsError(f"prompt {self.name} is nested too deeply") from fault
        except ValueError as fault:  # of Python, by a number of thousands of digits
            raise SettingsError(f"prompt {self.name} cannot be read: {str(fault)[:80]}") from fault
        known = {*VARIABLES, *_sandbox().globals, *_exported(tree)}
        for other in set(meta.find_referenced_templates(tree)) - {None}:
            there = _sandbox().list_templates()
            if other not in there:
                raise SettingsError(
                    f'prompt {self.name} uses the template "{other}", which does not exist.'
                    f"{did_you_mean(str(other), there)} Templates: {', '.join(there)}"
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
        *,
        memory: str = "none",
        name: str = "llm",
        proposals: int = 1,
        form: Form = "then-schema",
        hints: Sequence[str] = (),
    ) -> str:
        """The prompt for the next design after `history`; which designs it shows is drawn from `seed`.

        memory: "own" shows the earlier proposals of the proposer `name`, too.
        proposals: how many designs are asked for.
        hints: what the template makes nothing of stands at the end.

        At most about MOST_TOKENS long, unless hints and a template's own words are longer: of more targets, designs
        and proposals fewer are shown.
        """
        proposed = proposal_records(history, name) if memory == "own" else []
        feedback = Feedback(history, seed)
        common = common_values(history, memory, proposals, form) | {"n_proposed": len(proposed), "hints": _lines(hints)}
        most = MOST_TARGETS, max(len(feedback.front), len(feedback.others)), MOST_PROPOSED
        while True:
            text = self._with_hints({**common, **shown_values(history, feedback, proposed, *most)})
            fewer = _fewer(*most)
            if estimated_tokens(text) <= MOST_TOKENS or fewer == most:
                return text
            most = fewer

    def _with_hints(self, values: Mapping[str, Any]) -> str:
        text = self._render(values)
        if not values["hints"] or text != self._render({**values, "hints": []}):
            return text
        return text + "\n" + rendered("hints.md.j2", values)

    def _render(self, values: Mapping[str, Any]) -> str:
        try:
            text = _tidy(render(_sandbox().from_string(self.template), values))
        except _FAULTS as fault:
            line = next(
                (f.lineno for f in reversed(traceback.extract_tb(fault.__traceback__)) if f.filename == "<template>"),
                None,
            )
            where = "" if line is None else f", line {line}"
            words = one_line(str(fault), 300) or type(fault).__name__
            raise SettingsError(f"prompt {self.name}{where} cannot be rendered: {words}") from fault
        if not text.strip():
            raise SettingsError(f"prompt {self.name} is empty: there would be nothing to answer")
        return text


# What a template can run into.
_FAULTS = (
    TemplateError, TypeError, ValueError, ArithmeticError, LookupError, AttributeError, NameError, RecursionError,
    MemoryError
)  # fmt: skip


def load_prompt(name: str | Path) -> Prompt:
    """The prompt `plus` or `minus`, or the one of a template file."""
    if str(name) in PROMPTS:
        return _builtin_prompt(str(name))
    path = Path(name)
    if os.path.isdir(path):
        raise SettingsError(f"prompt {path} is a folder, not a template file")
    if not os.path.isfile(path):
        raise SettingsError(
            f'unknown prompt "{name}".{did_you_mean(str(name), PROMPTS)} Prompts: {", ".join(PROMPTS)}, or a file'
        )
    try:
        if path.stat().st_size > LARGEST_TEMPLATE:
            raise SettingsError(f"{path} is larger than {LARGEST_TEMPLATE // 1024} KiB; that is no prompt")
        text = path.read_text(encoding="utf-8-sig")
    except OSError as fault:
        raise SettingsError(f"cannot read {path}: {fault.strerror or fault}") from fault
    except UnicodeDecodeError as fault:
        raise SettingsError(f"{path} is not a text file in UTF-8") from fault
    # A file that is called as a prompt of ours must not pass for it.
    return Prompt(path.name if path.name not in PROMPTS else f"./{path.name}", text)


@cache
def _builtin_prompt(name: str) -> Prompt:
    return Prompt(name, builtin_template(f"{name}.md.j2"))


def builtin_template(name: str) -> str:
    """The text of a template that comes with armwright."""
    loader = _sandbox().loader
    assert loader is not None
    return loader.get_source(_sandbox(), name)[0]


def whole_template(name: str) -> str:
    """The template of a prompt as one text to make one's own from: that of `plus` and `minus` with what they extend."""
    template = load_prompt(name).template
    if name not in PROMPTS:
        return template
    whole = builtin_template("proposal.md.j2")
    for block, content in re.findall(r"{% block (\w+) %}\n(.*?){% endblock %}", template, re.DOTALL):
        start = f"{{% block {block} %}}\n"
        whole = whole.replace(start, start + content, 1)
    return whole


def parameters_prompt(problem: Problem, answer: str, *, proposals: int = 1, expected: bool = False) -> str:
    """The prompt of the second call: the free answer turned into parameters."""
    values = {
        "parameters": problem.space.parameters,
        "symbols": " and ".join(objective.symbol for objective in problem.objectives),
        "proposals": proposals,
        "expected": expected,
        **fenced(answer),
    }
    return rendered("parameters.md.j2", values)


def fenced(answer: str) -> dict[str, str]:
    """A free answer as material for a second call: without its thoughts, its end alone, and a fence that it lacks."""
    material = end_of(without_thoughts(answer).strip() or answer, LONGEST_ANALYSIS)
    return {"answer": material, "fence": fence(material)}


def rendered(name: str, values: Mapping[str, Any]) -> str:
    """A template that comes with armwright, with these values."""
    return _tidy(render(_sandbox().get_template(name), values))


def estimated_tokens(text: str) -> int:
    """About how many tokens a model makes of a text: words in pieces of 5 letters, numbers in pieces of 3 digits."""
    return len(re.findall(r"[0-9]{1,3}|[A-Za-z]{1,5}|\S", text))


def _lines(hints: Sequence[str]) -> list[str]:
    """Each hint on one line; one in which nothing is to be seen is left out."""
    return [line for hint in hints if (line := one_line(hint, LONGEST_HINT))]


def _fewer(targets: int, designs: int, proposed: int) -> tuple[int, int, int]:
    """A step less of everything, targets first."""
    if targets > FEWEST_TARGETS:
        return max(FEWEST_TARGETS, 3 * targets // 4), designs, max(FEWEST_PROPOSED, 3 * proposed // 4)
    return targets, max(1, designs - 1), FEWEST_PROPOSED


def _tidy(text: str) -> str:
    """Without blanks at line ends, and without more than one empty line in a row."""
    return re.sub(r"\n{3,}", "\n\n", re.sub(r"[ \t]+\n", "\n", text)).strip() + "\n"


def _exported(tree: nodes.Template) -> set[str]:
    """What a template gives to its blocks, and to those of templates that extend it: macros, and names it sets."""
    macros = {node.name for node in tree.find_all(nodes.Macro)}
    return macros | {
        node.target.name for node in tree.body if isinstance(node, nodes.Assign) and isinstance(node.target, nodes.Name)
    }


@cache
def _sandbox() -> Sandbox:
    return Sandbox("armwright.llm")
