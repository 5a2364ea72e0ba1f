"""A task and a design space drafted from words: what a model is told, and what is taken of its answer.

The words are in templates/draft.md.j2. What the files may hold is told from the models that load them, so that a key
that is new there is known here.
"""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from textwrap import dedent
from typing import Any, cast

from pydantic import BaseModel

from armwright.exceptions import SettingsError, TaskError
from armwright.llm.answer import LONGEST_ANSWER
from armwright.llm.prompt import rendered
from armwright.problem.objectives import MOST_OBJECTIVES, OBJECTIVES, PAPER_OBJECTIVES
from armwright.robot.actuators import ActuatorRecord, catalogue
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.joint_modules import JOINT_DESCRIPTIONS
from armwright.tasks.task import MOST_TARGETS, Task
from armwright.tasks.task_template import task_template
from armwright.text import end_of, fence, one_line, without_thoughts

LONGEST_WORDS = 10_000  # characters; who has more has points, and `armwright init --from` reads them
LONGEST_SHOWN = 20_000  # characters of a refused answer that goes back; the end counts
LONGEST_ASSUMED = 400  # characters of a line
MOST_ASSUMED = 40  # lines
EXAMPLE = "shelf"  # the built-in task that is shown
SPACE_EXAMPLE = """\
name: shelf-arm
joints: 5
joint_types: [P, Y]           # no roll: its motor would stand out sideways
origin_x: [-0.2, 0.1]         # in front of the boards, whose edge is at x = 0.4
origin_y: [-0.3, 0.3]
origin_z: [0.0, 0.5]          # on a post, which stands on the floor
link: [0.05, 0.30]            # 5 x 0.3 m is 1.4 times the distance of the farthest target
mass: {kind: tube, density: 2700, outer_diameter: 0.03, wall: 0.0015}     # aluminium tube
actuators: [STS3215-12V, XM430-W350, XM540-W270]
safety_factor: 2.0
"""

_HEADING = re.compile(r"[^\w\n]{0,8}(TASK|SPACE|ASSUMED|ASSUMPTIONS)(?: FILE)?[^\w\n]{0,8}", re.IGNORECASE)
_SEPARATOR = re.compile(r"-{3,}\s*")
_FENCE = re.compile(r"\s{0,8}(`{3,}|~{3,})[\w.+ -]{0,40}")
_ITEM = re.compile(r"\s*(?:[-*•]|\d{1,3}[.)])\s+(.*)")
_KEY = re.compile(r"^[\"']?([A-Za-z_]\w{0,60})[\"']?[ ]*:", re.MULTILINE)
_FLOW_KEY = re.compile(r"[{,]\s*[\"']?([A-Za-z_]\w{0,60})[\"']?\s*:")


@dataclass(frozen=True)
class Documents:
    """What an answer holds: the YAML of a task and, where there is one, of a space; what was assumed, line by line."""

    task: str
    space: str
    assumed: tuple[str, ...]


@dataclass(frozen=True)
class _Piece:
    """Lines of an answer: under which heading they stand, and whether in a block of code."""

    heading: str
    is_block: bool
    text: str


def draft_prompt(words: str, refused: str = "", refusal: str = "") -> str:
    """What is asked for somebody's words; with an answer that was refused, and why, what is asked again.

    SettingsError where the words are none, or too many.
    """
    shown = end_of(words.strip(), len(words))
    if not shown.strip():
        raise SettingsError('there are no words to draft from: armwright draft "reach the corners of a 0.5 m cube"')
    if len(words) > LONGEST_WORDS:
        raise SettingsError(
            f"the words have {len(words):,} characters; at most {LONGEST_WORDS:,} are taken. "
            "Points of a file are read by armwright init --from FILE"
        )
    space = DesignSpace()
    last = end_of(without_thoughts(refused).strip() or refused, LONGEST_SHOWN)
    ranges = (space.origin_x, space.origin_y, space.origin_z)
    values = {
        "words": shown,
        "fence": fence(shown),
        "most_targets": MOST_TARGETS,
        "reach": space.max_reach,
        "bases": ", ".join(f"{low:g} <= {axis} <= {high:g}" for axis, (low, high) in zip("xyz", ranges, strict=True)),
        "toy": space.mass.description,
        "task_schema": _schema(Task),
        "space_schema": _schema(DesignSpace),
        "most_objectives": MOST_OBJECTIVES,
        "paper_objectives": " and ".join(objective.name for objective in PAPER_OBJECTIVES),
        "objectives": tuple(OBJECTIVES.values()),
        "template": task_template(Path("my-task.yaml")),
        "example": (resources.files("armwright.tasks") / "builtin" / f"{EXAMPLE}.yaml").read_text(encoding="utf-8"),
        "space_example": SPACE_EXAMPLE,
        "joint_descriptions": JOINT_DESCRIPTIONS,
        "actuators": [_actuator_line(record) for record in catalogue().values()],
        "refusal": refusal,
        "answer": last,
        "answer_fence": fence(last),
    }
    return rendered("draft.md.j2", values)


def read_documents(text: str) -> Documents:
    """The files of an answer, in blocks or under headings, with or without words around; the last of each counts.

    TaskError where there is no task, or the answer is cut short. Nothing is checked of what they hold.
    """
    if len(text) > LONGEST_ANSWER:
        raise TaskError(f"the answer has {len(text):,} characters; at most {LONGEST_ANSWER:,} are read: be brief")
    pieces = _pieces(end_of(without_thoughts(text), LONGEST_ANSWER).splitlines())
    found = [(piece, _kind(piece.text)) for piece in pieces]
    if any(kind and piece.is_block for piece, kind in found):  # then what stands outside of blocks is about them
        found = [(piece, kind if piece.is_block else "") for piece, kind in found]
    last = {kind: f"{piece.text}\n" for piece, kind in found if kind}
    if "task" not in last:
        keys = ", ".join(Task.model_fields)
        raise TaskError(f"no task found: give it as one block of YAML with these keys: {keys}")
    under = [piece.text for piece, kind in found if piece.heading.startswith("assum") and not kind]
    return Documents(last["task"], last.get("space", ""), tuple(_items("\n".join(under))))


def _pieces(lines: Sequence[str]) -> list[_Piece]:
    """An answer taken apart at headings, lines of dashes, and the borders of blocks of code."""
    pieces: list[_Piece] = []
    heading, border, content = "", "", list[str]()

    def end(is_block: bool) -> None:
        pieces.append(_Piece(heading, is_block, dedent("\n".join(content)).strip()))
        content.clear()

    for line in lines:
        bare = line.strip()
        opens = None if border else _FENCE.fullmatch(line)
        if border and bare.startswith(border) and not bare.strip(border[0]):
            end(is_block=True)
            border = ""
        elif opens:
            end(is_block=False)
            border = opens[1]
        elif _SEPARATOR.fullmatch(line):
            end(is_block=bool(border))
        elif found := _HEADING.fullmatch(line):
            end(is_block=bool(border))
            heading = found[1].lower()
        else:
            content.append(line)
    if border:
        raise TaskError("the answer is cut short: its last block of code does not end. Give all of it, and be brief")
    end(is_block=False)
    return pieces


def _kind(text: str) -> str:
    """task, space, or nothing, by the keys that only one of them has."""
    keys = set((_FLOW_KEY if text.startswith("{") else _KEY).findall(text))
    of_task = len(keys & (Task.model_fields.keys() - DesignSpace.model_fields.keys()))
    of_space = len(keys & (DesignSpace.model_fields.keys() - Task.model_fields.keys()))
    if not of_task + of_space:
        return ""
    return "task" if of_task >= of_space else "space"


def _items(text: str) -> list[str]:
    """The items of a list in an answer; a line without a sign of its own goes on with the one before."""
    items: list[str] = []
    for line in text.splitlines():
        if found := _ITEM.fullmatch(line):
            items.append(found[1])
        elif line.strip() and items:
            items[-1] += f" {line.strip()}"
        elif line.strip():
            items.append(line)
    return [one_line(item, LONGEST_ASSUMED) for item in items if item.strip()][:MOST_ASSUMED]


def _schema(model: type[BaseModel]) -> str:
    """The JSON schema of what a file holds; of `restrict` and its like in the form in which it is written there."""
    return json.dumps(_without_titles(model.model_json_schema(mode="serialization")), ensure_ascii=False)


def _without_titles(schema: Any) -> Any:
    """Pydantic's titles repeat the names."""
    if isinstance(schema, dict):
        fields = cast("dict[str, Any]", schema).items()
        return {k: _without_titles(v) for k, v in fields if k != "title" or not isinstance(v, str)}
    if isinstance(schema, list):
        return [_without_titles(item) for item in cast("list[Any]", schema)]
    return schema


def _actuator_line(record: ActuatorRecord) -> str:
    told: Mapping[str, float | None] = {
        "mass": record.mass,
        "stall": record.stall_torque,
        "rated": record.rated_torque,
        "peak": record.peak_torque,
        "price": record.price,
    }
    numbers = ", ".join(f"{name} {value:g}" for name, value in told.items() if value is not None)
    return f"- {record.name} ({record.maker}): {numbers}"
