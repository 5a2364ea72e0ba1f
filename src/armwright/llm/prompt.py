"""What the model is told: the problem, feedback on past designs, and how to think. The words are in templates/."""

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined, TemplateError, TemplateSyntaxError, meta
from jinja2.sandbox import ImmutableSandboxedEnvironment

from armwright.exceptions import SettingsError, did_you_mean
from armwright.history import History
from armwright.kinematics.solve import UPDATES
from armwright.llm.feedback import Record, design_records, drawn_designs, points, proposal_records, vector
from armwright.problem import Problem
from armwright.space import JOINT_WORDS

PROMPTS = ("plus", "minus")
Memory = Literal["none", "own"]
MEMORIES: tuple[str, ...] = get_args(Memory)
Form = Literal["text", "then-schema", "schema"]  # of the answer: free; free, and a second call extracts it; by schema

MOST_TOKENS = 12_000  # of a prompt; beyond it fewer targets, designs and earlier proposals are shown
MOST_TARGETS, FEWEST_TARGETS = 64, 4  # shown
MOST_PROPOSED, FEWEST_PROPOSED = 20, 4  # earlier proposals shown
LARGEST_TEMPLATE = 256 * 1024  # characters

# What a template may use; the answer to `armwright prompt --variables`.
VARIABLES = {
    "space": "the design space: joints, joint_types, joint_range, origin_x, origin_y, origin_z, link, mass_note",
    "joint_words": "what each joint type is, by its letter",
    "task": "the task: name, description",
    "targets": "the target points as text; n_targets_shown of n_targets",
    "n_targets": "how many targets the task has",
    "n_targets_shown": "how many of them are listed",
    "target_low": "the least x, y and z of all targets",
    "target_high": "the largest x, y and z of all targets",
    "updates": "updates of the inverse kinematics",
    "objectives": "what is minimised, each with symbol, label, unit, words",
    "reference_point": "of the hypervolume; none as long as there is none",
    "n_finished": "how many designs have been evaluated",
    "n_front": "how many of them are Pareto-optimal",
    "front": "some members of the front: number, origin, joints, links, e_each, p_ik, tau_ik, limits, load, e_all",
    "others": "some other designs, with the same",
    "proposed": "--memory own: earlier proposals: number, origin, joints, links, expected, e_all, on_front, reason",
    "n_proposed": "how many proposals there were",
    "proposals": "how many designs to propose",
    "expected": "whether the expected objectives are asked for",
    "form": 'of the answer: "schema", "then-schema" (free text, a second call extracts it) or "text" (free text alone)',
}


@dataclass(frozen=True)
class Prompt:
    """A prompt's name and its Jinja template."""

    name: str
    template: str

    def __post_init__(self) -> None:
        """SettingsError where the template cannot be read."""
        try:
            used = meta.find_undeclared_variables(_environment().parse(self.template))
        except TemplateSyntaxError as fault:
            raise SettingsError(f"prompt {self.name}, line {fault.lineno}: {fault.message}") from fault
        for name in sorted(used - VARIABLES.keys()):
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
    ) -> str:
        """The prompt for the next design after `history`; which designs it shows is drawn from `seed`.

        memory: "own" shows the earlier proposals of the proposer `name`, too.
        proposals: how many designs are asked for.

        At most about MOST_TOKENS long: of more targets, designs and proposals fewer are shown.
        """
        proposed = proposal_records(history, name) if memory == "own" else []
        numbers = drawn_designs(history, seed)
        common = _common(history, memory, proposals, form) | {"n_proposed": len(proposed)}
        most = MOST_TARGETS, len(numbers[0]) + len(numbers[1]), MOST_PROPOSED
        while True:
            text = self._render({**common, **_shown(history, numbers, proposed, *most)})
            fewer = _fewer(*most)
            if estimated_tokens(text) <= MOST_TOKENS or fewer == most:
                return text
            most = fewer

    def _render(self, values: dict[str, Any]) -> str:
        try:
            text = _environment().from_string(self.template).render(values)
        except (TemplateError, TypeError, ValueError, ArithmeticError, LookupError, AttributeError) as fault:
            raise SettingsError(f"prompt {self.name} cannot be rendered: {' '.join(str(fault).split())}") from fault
        return _tidy(text)


def load_prompt(name: str | Path) -> Prompt:
    """The prompt `plus` or `minus`, or the one of a template file."""
    if str(name) in PROMPTS:
        return Prompt(str(name), builtin_template(f"{name}.md.j2"))
    path = Path(name)
    if not os.path.isfile(path):
        raise SettingsError(
            f'unknown prompt "{name}".{did_you_mean(str(name), PROMPTS)} Prompts: {", ".join(PROMPTS)}, or a file'
        )
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as fault:
        raise SettingsError(f"cannot read {path}: {fault.strerror or fault}") from fault
    except UnicodeDecodeError as fault:
        raise SettingsError(f"{path} is not a text file in UTF-8") from fault
    if len(text) > LARGEST_TEMPLATE:
        raise SettingsError(f"{path} is larger than {LARGEST_TEMPLATE // 1024} KiB; that is no prompt")
    return Prompt(path.name, text)


def builtin_template(name: str) -> str:
    """The text of a template that comes with armwright."""
    loader = _environment().loader
    assert loader is not None
    return loader.get_source(_environment(), name)[0]


def parameters_prompt(problem: Problem, answer: str, *, proposals: int = 1, expected: bool = False) -> str:
    """The prompt of the second call: the free answer turned into parameters."""
    values = {"parameters": problem.space.parameters, "proposals": proposals, "expected": expected, "answer": answer}
    return rendered("parameters.md.j2", values)


def rendered(name: str, values: Mapping[str, Any]) -> str:
    """A template that comes with armwright, with these values."""
    return _tidy(_environment().get_template(name).render(values))


def estimated_tokens(text: str) -> int:
    """About how many tokens a model makes of a text: words in pieces of 5 letters, numbers in pieces of 3 digits."""
    return len(re.findall(r"\d{1,3}|[^\W\d_]{1,5}|[^\w\s]|_", text))


def _common(history: History, memory: str, proposals: int, form: Form) -> dict[str, Any]:
    problem = history.problem
    return {
        "space": problem.space,
        "joint_words": JOINT_WORDS,
        "task": problem.task,
        "n_targets": len(problem.task.points),
        "target_low": vector(problem.task.points.min(axis=0)),
        "target_high": vector(problem.task.points.max(axis=0)),
        "updates": UPDATES,
        "objectives": problem.objectives,
        "reference_point": history.reference_point,
        "n_finished": len(history),
        "n_front": len(history.front),
        "proposals": proposals,
        "expected": memory == "own",
        "form": form,
    }


def _shown(
    history: History,
    numbers: tuple[list[int], list[int]],
    proposed: Sequence[Record],
    most_targets: int,
    most_designs: int,
    most_proposed: int,
) -> dict[str, Any]:
    """Targets, designs and earlier proposals, at most so many of each."""
    points_ = history.problem.task.points
    shown = spread(len(points_), most_targets)
    others = numbers[1][: most_designs // 2]
    front = numbers[0][: most_designs - len(others)]
    return {
        "targets": points(points_[shown]),
        "n_targets_shown": len(shown),
        "front": design_records(history, front, shown),
        "others": design_records(history, others, shown),
        "proposed": proposed[-most_proposed:],
    }


def _fewer(targets: int, designs: int, proposed: int) -> tuple[int, int, int]:
    """A step less of everything, targets first."""
    if targets > FEWEST_TARGETS:
        return max(FEWEST_TARGETS, 3 * targets // 4), designs, max(FEWEST_PROPOSED, 3 * proposed // 4)
    return targets, max(1, designs - 1), FEWEST_PROPOSED


def spread(n: int, most: int) -> list[int]:
    """At most `most` of the places 0 … n-1, evenly spread."""
    return sorted({round(place) for place in np.linspace(0, n - 1, min(n, most))})


def _tidy(text: str) -> str:
    """Without blanks at line ends, and without more than one empty line in a row."""
    return re.sub(r"\n{3,}", "\n\n", re.sub(r"[ \t]+\n", "\n", text)).strip() + "\n"


@cache
def _environment() -> Environment:
    # A sandbox, because templates are files that people pass on. The output is a prompt, not a page: nothing is
    # to be escaped.
    return ImmutableSandboxedEnvironment(
        loader=PackageLoader("armwright.llm"), undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
