"""The line format of free answers: ORIGIN, JOINTS, LINKS and more, each with its values on its line."""

import re
from collections.abc import Collection, Mapping
from typing import Any, cast

from armwright.spaces.joint_modules import JOINT_DESCRIPTIONS
from armwright.units import UNSIGNED

AXES = ("x", "y", "z")
LISTS = {  # lists with a value per module, and the prefix of their parameters
    "joints": "joint", "links": "link", "tubes": "tube", "motors": "motor", "directions": "direction",
    "strokes": "stroke", "ranges": "limit",
}  # fmt: skip
SINGLE = ("mount", "tube")  # choices of a whole arm, under the names of their parameters
NOTHING = "-"  # in a list, for a module without such a value
JOINT_NAMES = {description.partition(",")[0]: kind for kind, description in JOINT_DESCRIPTIONS.items()}  # "yaw": "Y"
NO_CUSTOM: Mapping[str, bool] = {}

_MINUS = str.maketrans({"−": "-", "﹣": "-", "-": "-", "＋": "+"})
_NUMBER = re.compile(rf"[-+]?(?:{UNSIGNED}|nan|inf(?:inity)?)", re.IGNORECASE)
# A name at the start of a line, with any list marker or emphasis, and the rest of a line that is not too long.
_LINE = re.compile(r"^[ \t>*#`|•–-]{0,20}(?:\d+[.)] ?)?[*`]{0,3}([A-Za-z]\w*)[ *`]*[:=](.{0,2000})$", re.MULTILINE)
_EMPHASIS = " \t*_`"  # around values, which does not count


def module_lists(names: Collection[str]) -> dict[str, str]:
    """Return the lists of a space by the names of its parameters, without joints and links, each with its prefix."""
    return {group: kind for group, kind in LISTS.items() if group not in ("joints", "links") and f"{kind}_1" in names}


def design_in_lines(text: str, custom: Mapping[str, bool] = NO_CUSTOM) -> tuple[int, dict[str, Any]]:
    """Return the position of the last design or -1, and its parameters.

    A design begins with its ORIGIN, so that an unfinished one takes no values from another. `custom` says of each
    custom parameter whether it has a value per joint.
    """
    known = {"origin", "reason", *SINGLE, *LISTS, *custom}
    design: dict[str, Any] = {}
    last = -1
    for line in _LINE.finditer(text):
        name = line[1].lower()
        if name == "origin":
            design, last = {}, line.start()
        if last < 0 or name not in known:
            continue
        for key, value in expand_lists({name: line[2].strip(_EMPHASIS)}, custom).items():
            before = design.setdefault(key, value)
            if before != value and name != "reason":  # contradictory: refused later
                design[key] = f"{before} and {value}"
    return last, design


def expand_lists(content: Mapping[str, Any], custom: Mapping[str, bool] = NO_CUSTOM) -> dict[str, Any]:
    """Return an object's values by parameter; groups may be lists or text, as in "origin": [0, 0.1, 0].

    `custom` says of each custom parameter whether it has a value per joint.
    """
    groups = {"origin", *LISTS, *(name for name, per_joint in custom.items() if per_joint)}
    values: dict[str, Any] = {}
    for name, value in content.items():
        if name in groups and isinstance(value, (str, list)):
            items: list[Any] = _items(name, value) if isinstance(value, str) else cast("list[Any]", value)
            values.update({_parameter(name, i): item for i, item in enumerate(items) if item not in (None, NOTHING)})
        else:
            values[name] = value
    return values


def plain_number(text: str, unit: str = "") -> float | None:
    """Return the number that a text consists of, with or without its unit; None for any other text."""
    text = text.strip().translate(_MINUS).removesuffix(unit).strip()
    return float(text) if _NUMBER.fullmatch(text) else None


def _items(group: str, text: str) -> list[str]:
    """Return the items of a list in brackets or without: with commas or blanks between them, or joints as one word."""
    inside = re.sub(r"[()\[\]{}]", " ", text).strip()
    items = [item.strip(_EMPHASIS) for item in re.split(r"[,;]" if re.search("[,;]", inside) else r"\s+", inside)]
    items = [item for item in items if item]
    return list(items[0]) if group == "joints" and len(items) == 1 and items[0].isupper() else items


def _parameter(group: str, index: int) -> str:
    if group == "origin" and index < len(AXES):
        return f"origin_{AXES[index]}"
    return f"{LISTS.get(group, group)}_{index + 1}"
