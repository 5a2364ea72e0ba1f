"""What the model is told: the problem, feedback on past designs, and how to think. The words are in templates/."""

import os
import re
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from jinja2 import TemplateError, TemplateSyntaxError, meta, nodes

from armwright.arm import GRAVITY
from armwright.control import LONGEST_HINT
from armwright.exceptions import SettingsError, did_you_mean
from armwright.history import History
from armwright.kinematics.paths import UPDATES_OF_STEP
from armwright.kinematics.solve import UPDATES
from armwright.llm.feedback import Feedback, Record, points, proposal_records, vector
from armwright.llm.lines import LISTS
from armwright.llm.sandbox import Sandbox, render
from armwright.llm.words import end_of, fence, one_line, without_thoughts
from armwright.modules import JOINT_DESCRIPTIONS, MODULES, MOUNT_DESCRIPTIONS
from armwright.objectives import (
    OF_CLEARANCE,
    OF_MOVES,
    OF_THE_WAY,
    OF_TIME,
    ORIENTATION_ERROR,
    POSITION_ERROR,
    UNCOVERED_FRACTION,
    UNREACHED_TARGETS,
    Objective,
)
from armwright.problem import Problem
from armwright.targets import REACHED, target_words
from armwright.task import IN_ORDER, Task
from armwright.tolerance import measured_columns

PROMPTS = ("plus", "minus")
Memory = Literal["none", "own"]
MEMORIES: tuple[str, ...] = get_args(Memory)
Form = Literal["text", "then-schema", "schema"]  # of the answer: free; free, and a second call extracts it; by schema

MOST_TOKENS = 12_000  # of a prompt; beyond it fewer targets, designs and earlier proposals are shown
MOST_TARGETS, FEWEST_TARGETS = 64, 4  # shown
MOST_PROPOSED, FEWEST_PROPOSED = 20, 4  # earlier proposals shown
LONGEST_DESCRIPTION = 2_000  # characters of a task's description
LONGEST_ANALYSIS = 40_000  # characters of a free answer that the second call reads; the end counts
LARGEST_TEMPLATE = 256 * 1024  # [bytes]

# What a template may use; the answer to `armwright prompt --variables`.
VARIABLES = {
    "space": "the design space: min_joints, max_joints, joint_types, joint_range, origin_x, origin_y, origin_z, "
    "link, mass_note, and all else that a space file can hold",
    "n_joints": "how many joints an arm has, as text; D where that is searched",
    "turning": "the joint types that turn",
    "sliding": "the joint types that slide",
    "straight": "whether all links stand in one vertical line at first",
    "asked": "what a design has beside base, joints and links: name in capitals, and name of a parameter",
    "n_copies": "how many copies of a design a tolerance makes",
    "joint_descriptions": "what each joint type is, by its letter",
    "mount_descriptions": "how an arm stands, by the mount",
    "gravity": "[m/s²], along -z",
    "task": "the task: name, and more",
    "description": "what the task says of itself, on one line",
    "targets": "the target points as text; n_targets_shown of n_targets",
    "restricted": "parameters that are fixed or narrower than the space's ranges: name with low and high, or choices",
    "payload": "what the tip carries at the targets, as text; empty for nothing",
    "obstacles": "what the arm should keep away from, each as text; none as a rule",
    "collisions": "whether what the arm touches counts in an objective",
    "asks": "what targets say beside their points, such as an axis for the tool, a line each; empty for points alone",
    "oriented": "whether any target asks for an axis or an orientation of the tool",
    "restarts": "further starts of the inverse kinematics at each target",
    "moves": "the straight lines that the tip goes along, as text; empty where none counts in an objective",
    "move_times": "how long the moves take, as text; empty where that counts in no objective",
    "workspace": "boxes that the tip should cover, each as text; none where they count in no objective",
    "of_the_way": "the objectives of which a target's share is the worst of it and of the moves that end there",
    "updates_of_step": "updates of the inverse kinematics from one sample of a move to the next",
    "n_targets": "how many targets the task has",
    "n_targets_shown": "how many of them are listed",
    "target_low": "the least x, y and z of all targets",
    "target_high": "the largest x, y and z of all targets",
    "updates": "updates of the inverse kinematics",
    "objectives": "what is minimised, each with symbol, label, unit, words, over (sum, max, mean square or arm)",
    "constraints": "what a design has to keep, each with quantity (as an objective), relation, bound",
    "n_feasible": "how many of the evaluated designs keep all of these",
    "cases": "what the task may come to beside what it says, as text; empty for nothing",
    "tolerance": "[m] by which base and links may be off, the worst case of which counts; 0: designs as they stand",
    "reference_point": "of the hypervolume; none as long as there is none",
    "n_finished": "how many designs have been evaluated",
    "n_front": "how many of them are Pareto-optimal",
    "front": "members of the front, by rising first objective: number, origin, joints, links, extras, e_each, p_ik, "
    "a_ik, missed, tau_ik, limits, load, e_all, broken (which constraints, or none; empty where there are none); as "
    "long as no design is feasible (n_feasible), those nearest to it",
    "others": "some other designs, with the same",
    "proposed": "--memory own: earlier proposals: number, origin, joints, links, extras, expected, e_all, broken, "
    "reason",
    "n_proposed": "how many proposals there were",
    "proposals": "how many designs to propose",
    "expected": "whether the expected objectives are asked for",
    "hints": "notes of an engineer who watches the search, for this prompt alone, each on one line; as a rule none",
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
        common = _common(history, memory, proposals, form) | {"n_proposed": len(proposed), "hints": _lines(hints)}
        most = MOST_TARGETS, max(len(feedback.front), len(feedback.others)), MOST_PROPOSED
        while True:
            text = self._with_hints({**common, **_shown(history, feedback, proposed, *most)})
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


def _common(history: History, memory: str, proposals: int, form: Form) -> dict[str, Any]:
    problem, space = history.problem, history.problem.space
    names = {parameter.name for parameter in space.parameters}
    turning = [kind for kind in space.joint_types if MODULES[kind].is_revolute]
    asked = [("MOUNT", "mount")] if "mount" in names else []
    asked += [
        (group.upper(), kind)
        for group, kind in LISTS.items()
        if group not in ("joints", "links") and f"{kind}_1" in names
    ]
    return {
        "space": space,
        "n_joints": str(space.max_joints) if space.min_joints == space.max_joints else "D",
        "turning": turning,
        "sliding": [kind for kind in space.joint_types if MODULES[kind].is_prismatic],
        "straight": space.mount == ("floor",) and space.link_directions == ("+z",),
        "asked": asked,
        "n_copies": len(measured_columns(space)) * 2,
        "joint_descriptions": JOINT_DESCRIPTIONS,
        "mount_descriptions": MOUNT_DESCRIPTIONS,
        "gravity": GRAVITY,
        "task": problem.task,
        "description": one_line(problem.task.description, LONGEST_DESCRIPTION),
        "restricted": [p for p in problem.space.parameters if p.name in dict(problem.space.restrict)],
        "payload": _payload_words(problem.task),
        "obstacles": [obstacle.words() for obstacle in problem.task.obstacles],
        "collisions": problem.uses(*OF_CLEARANCE),
        "oriented": problem.task.goals.oriented,
        "restarts": problem.task.restarts,
        "moves": _move_words(problem.task) if problem.uses(*OF_MOVES) else "",
        "move_times": _time_words(problem.task) if problem.uses(*OF_TIME) else "",
        "workspace": [region.words() for region in problem.task.workspace] if problem.uses(UNCOVERED_FRACTION) else [],
        "of_the_way": [quantity.symbol for quantity in OF_THE_WAY if problem.uses(quantity)],
        "updates_of_step": UPDATES_OF_STEP,
        "n_targets": len(problem.task.points),
        "updates": UPDATES,
        "objectives": [_spoken(objective, problem.task) for objective in problem.objectives],
        "constraints": problem.constraints,
        "n_feasible": int(history.feasible.sum()),
        "cases": problem.task.case_words,
        "tolerance": problem.tolerance,
        "reference_point": history.reference_point,
        "n_finished": len(history),
        "n_front": len(history.front),
        "proposals": proposals,
        "expected": memory == "own",
        "form": form,
    }


def _lines(hints: Sequence[str]) -> list[str]:
    """Each hint on one line; one in which nothing is to be seen is left out."""
    return [line for hint in hints if (line := one_line(hint, LONGEST_HINT))]


def _spoken(objective: Objective, task: Task) -> Objective:
    """An objective whose words say what this task's tolerances and weights make of it."""
    goals = task.goals
    if objective == UNREACHED_TARGETS and (goals.oriented or np.any(goals.tolerance != REACHED)):
        angle = " or the tool's direction by its angle tolerance" if goals.oriented else ""
        return replace(objective, words=f"1 where the tip misses the target by its tolerance{angle} or more, else 0")
    if objective in (POSITION_ERROR, ORIENTATION_ERROR) and np.any(goals.weight != 1.0):
        return replace(objective, words=f"{objective.words}, times the target's weight")
    return objective


def _payload_words(task: Task) -> str:
    """What the tip carries; empty where that is nothing."""
    payloads = task.payloads
    if not payloads.any():
        return ""
    if np.ptp(payloads) == 0.0:
        return f"At every target the tip carries a payload of {payloads[0]:g} kg, a point mass."
    shown = spread(len(payloads), MOST_TARGETS)
    each = "each" if len(shown) == len(payloads) else "some of"
    listed = ", ".join(f"{payloads[i]:g}" for i in shown)
    return f"At the targets the tip carries payloads, point masses of [kg], for {each} TARGET in this order: {listed}."


def _move_words(task: Task) -> str:
    """The straight moves, by numbers of targets; empty where there are none."""
    pairs = task.lines.pairs
    if task.moves == IN_ORDER:
        return "from each target to the next, in the order of the list"
    shown = [pairs[i] for i in spread(len(pairs), MOST_TARGETS)]
    listed = ", ".join(f"{start + 1} to {end + 1}" for start, end in shown)
    more = "" if len(shown) == len(pairs) else f" (some of {len(pairs)})"
    return f"between the targets of these numbers, counted from 1: {listed}{more}" if pairs else ""


def _time_words(task: Task) -> str:
    """How long the moves take; empty where that is not said."""
    times = task.lines.times
    if not times:
        return ""
    if len(set(times)) == 1:
        return f"{times[0]:g} s"
    shown = spread(len(times), MOST_TARGETS)
    more = "" if len(shown) == len(times) else f" (some of {len(times)})"
    return f"{', '.join(f'{times[i]:g}' for i in shown)} s, in the order of the moves{more}"


def _shown(
    history: History,
    feedback: Feedback,
    proposed: Sequence[Record],
    most_targets: int,
    most_designs: int,
    most_proposed: int,
) -> dict[str, Any]:
    """At most so many targets, designs of the front, other designs, and earlier proposals."""
    points_, decimals = history.problem.task.points, feedback.digits.length
    shown = spread(len(points_), most_targets)
    front = [feedback.front[place] for place in spread(len(feedback.front), most_designs)]
    others = [feedback.others[place] for place in spread(len(feedback.others), most_designs)]
    return {
        "targets": points(points_[shown], decimals),
        "asks": target_words([history.problem.task.entries[place] for place in shown]),
        "target_low": vector(points_.min(axis=0), decimals),
        "target_high": vector(points_.max(axis=0), decimals),
        "n_targets_shown": len(shown),
        "front": feedback.records(front, shown),
        "others": feedback.records(others, shown),
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


def _exported(tree: nodes.Template) -> set[str]:
    """What a template gives to its blocks, and to those of templates that extend it: macros, and names it sets."""
    macros = {node.name for node in tree.find_all(nodes.Macro)}
    return macros | {
        node.target.name for node in tree.body if isinstance(node, nodes.Assign) and isinstance(node.target, nodes.Name)
    }


@cache
def _sandbox() -> Sandbox:
    return Sandbox("armwright.llm")
