"""The line format of free answers: ORIGIN, JOINTS, LINKS and more.

A line is read only if all of it is understood; numbers mixed with other text are no value.
"""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import cache
from typing import Any

from armwright.spaces.joint_modules import JOINT_DESCRIPTIONS
from armwright.units import UNSIGNED

AXES = ("x", "y", "z")
LISTS = {  # lists with a value per module, and the prefix of their parameters
    "joints": "joint", "links": "link", "tubes": "tube", "motors": "motor", "directions": "direction",
    "strokes": "stroke", "ranges": "limit",
}  # fmt: skip
SINGLE = ("mount", "tube")  # choices of a whole arm, under the names of their parameters
GROUPS = ("origin", *SINGLE, *LISTS)
NOTHING = "-"  # in a list, for a module without such a value
JOINT_NAMES = {description.partition(",")[0]: kind for kind, description in JOINT_DESCRIPTIONS.items()}  # "yaw": "Y"
NO_CUSTOM: Mapping[str, bool] = {}
MAX_LINE_LENGTH = 2000  # characters; longer lines are ignored

_MINUS = str.maketrans({"−": "-", "﹣": "-", "-": "-", "＋": "+"})
_NUMBER = rf"(?<![\w.])[-+]?(?:{UNSIGNED}|(?:nan|inf(?:inity)?)(?![A-Za-z]))"
_PLAIN = re.compile(_NUMBER, re.IGNORECASE)
_ITEM = re.compile(rf"({_NUMBER})[ ]?([A-Za-zµ°%]*)", re.IGNORECASE)
_NAMED = re.compile(rf"((?:origin|link|stroke|limit)_\w{{1,40}})\s*[:=]\s*({_NUMBER})[ ]?([A-Za-zµ°%]*)", re.IGNORECASE)
_NAMES_ALONE = re.compile(
    r"\((?:(?:origin|link|joint|stroke|limit|direction|tube|motor)_\w++|\.\.\.|…|[,\s])++\)\s*[:=]", re.IGNORECASE
)
# Items of the lines that hold names; "-" stands for a module without such a value.
_SIZE = re.compile(r"(?<!\S)-(?!\S)|[\d.]{1,20} ?[x×] ?[\d.]*\d")
_WORDS = {
    "mount": re.compile(r"[A-Za-z]+(?:[-+][xy])?"),
    "tube": _SIZE,
    "tubes": _SIZE,
    "motors": re.compile(r"(?<!\S)-(?!\S)|[A-Za-z0-9][A-Za-z0-9._-]*"),
    "directions": re.compile(r"[-+] ?[xyzXYZ]"),
}
_BRACKETS = re.compile(r"[(\[{]([^()\[\]{}]*)[)\]}]")
_LATEX = re.compile(r"\\(?:[A-Za-z]+|[,;:! ()\[\]])")
_HAS_NUMBER, _HAS_LETTER = re.compile(r"\d|nan|inf", re.IGNORECASE), re.compile(r"[A-Za-z]")
_LEFT_OVER = re.compile(r"[\s,;|()\[\]{}$*_`~≈\"'.]*")  # allowed between values


@cache
def _names(custom: Collection[str]) -> re.Pattern[str]:
    """Return the pattern of a name with its colon.

    It is at the start of a line with any list marker or emphasis; in capitals also within the line.
    """
    names = [*(group.upper() for group in (*GROUPS, *custom)), "REASON"]
    keywords = "|".join(sorted(names, key=len, reverse=True) if custom else names)
    return re.compile(
        rf"(?:^[ \t>*_#`|•–-]{{0,20}}(?:\d+[.)] ?)?[*_`]{{0,3}}(?P<first>(?i:{keywords}))"
        rf"|(?<=[\s;,])[*_`]{{0,3}}(?P<later>{keywords}))[ \t*_`]*[:=]",
        re.MULTILINE,
    )


def module_lists(names: Collection[str]) -> dict[str, str]:
    """Return the lists of a space by the names of its parameters, without joints and links, each with its prefix."""
    return {group: kind for group, kind in LISTS.items() if group not in ("joints", "links") and f"{kind}_1" in names}


def design_in_lines(text: str, custom: Mapping[str, bool] = NO_CUSTOM) -> tuple[int, dict[str, Any]]:
    """Return the position of the last design or -1, and its parameters.

    A design begins with its ORIGIN, so that an unfinished one takes no values from another. `custom` says of each
    custom parameter whether it has a value per joint.
    """
    design: dict[str, Any] = {}
    last = -1
    for position, name, line in _named_lines(text, tuple(custom)):
        if len(line) > MAX_LINE_LENGTH:
            continue
        values = _custom_values(name, line, custom[name]) if name in custom else _values(name, line)
        if values is None:
            continue
        if name == "origin":
            design, last = {}, position
        if last >= 0:
            for key, value in values.items():
                before = design.setdefault(key, value)
                if repr(before) != repr(value) and name != "reason":  # contradictory: refused later
                    design[key] = f"{before} and {value}"
    return last, design


def expand_lists(content: Mapping[str, Any], custom: Mapping[str, bool] = NO_CUSTOM) -> dict[str, Any]:
    """Return an object's values by parameter; groups may be lists or text, as in "origin": [0, 0.1, 0].

    `custom` says of each custom parameter whether it has a value per joint.
    """
    lists = {name for name, per_joint in custom.items() if per_joint}
    values: dict[str, Any] = {}
    for name, value in content.items():
        if name in (*GROUPS, *lists) and isinstance(value, str):
            found = _custom_values(name, value, True) if name in lists else _values(name, value)
            values.update(found or {name: value})
        elif name in (*GROUPS, *lists) and isinstance(value, (list, tuple)):
            items: list[Any] = list(value)  # pyright: ignore[reportUnknownVariableType, reportUnknownArgumentType]
            values.update({_parameter(name, i): item for i, item in enumerate(items) if item not in (None, NOTHING)})
        else:
            values[name] = value
    return values


def plain_number(text: str, unit: str = "") -> float | None:
    """Return the number that a text consists of, with or without its unit; None for any other text."""
    text = text.strip().translate(_MINUS).removesuffix(unit).strip()
    return float(text) if _PLAIN.fullmatch(text) else None


def _custom_values(name: str, text: str, per_joint: bool) -> dict[str, Any] | None:
    """Return the values of a line of a custom parameter, as text that still has to be checked."""
    text = re.sub(rf"\b{name}_\d+\s*[:=]", "", _LATEX.sub(" ", text.translate(_MINUS))).strip(" \t*_`.;|$")
    if not per_joint:
        return {name: text} if text else None
    inside = re.sub(r"[()\[\]{}]", " ", text)
    items = [item.strip(" \t*_`") for item in re.split(r"[,;]" if re.search(r"[,;]", inside) else r"\s+", inside)]
    return _listed(name, [item for item in items if item])


def _named_lines(text: str, custom: tuple[str, ...]) -> Iterator[tuple[int, str, str]]:
    """Yield each name with its position and the rest of its line, or the next line if there is no rest."""
    names = list(_names(custom).finditer(text))
    ends = [*(match.start() for match in names[1:]), len(text)]
    for match, end in zip(names, ends, strict=False):  # without names there is one end too many
        lines = text[match.end() : end].lstrip(" \t*_`").lstrip("\n").splitlines()
        yield match.start(), (match["first"] or match["later"]).lower(), lines[0] if lines else ""


def _values(name: str, text: str) -> dict[str, Any] | None:
    """Return the values of a line by parameter; None if it holds no values."""
    if name == "reason":
        return {"reason": text.strip(" \t*_`")}
    text = _LATEX.sub(" ", text.translate(_MINUS))
    if name == "joints":
        return _joints(text)
    if name in _WORDS:
        words = _WORDS[name].findall(_spaced(re.sub(rf"{LISTS.get(name, name)}_\d+\s*[:=]", "", text)))
        words = [word.replace("×", "x").replace(" ", "").rstrip(".") for word in words]
        words = words if name == "motors" else [word.lower() for word in words]
        return _listed(name, words) if name in LISTS else {name: words[0]} if len(words) == 1 else None
    if name == "origin":
        text = re.sub(r"(?<!\w)([xyz])\s*[:=]", r"origin_\1 =", text)
    elif name == "links":
        text = re.sub(r"(?<!\w)[lL]_?(\d+)\s*[:=]", r"link_\1 =", text)
    named = _NAMED.findall(text)
    if named:
        rest = _LEFT_OVER.fullmatch(_NAMED.sub("", text))
        return {key.lower(): _with_unit(number, unit) for key, number, unit in named} if rest else None
    text = _in_brackets(_NAMES_ALONE.sub("", text), _HAS_NUMBER)
    if name in ("strokes", "ranges"):
        text = re.sub(r"(?<!\S)-(?!\S)", "nan", _spaced(text))
    items = _ITEM.findall(text)
    if not items or not _LEFT_OVER.fullmatch(_ITEM.sub("", text)):
        return None
    has_gaps = name in ("strokes", "ranges")
    return _listed(name, [NOTHING if has_gaps and item[0] == "nan" else _with_unit(*item) for item in items])


def _spaced(text: str) -> str:
    """Replace the separators of a list by blanks."""
    return re.sub(r"[,;|()\[\]{}]", " ", text)


def _listed(group: str, values: Sequence[Any]) -> dict[str, Any] | None:
    """Return the values of a list by parameter; None if there are none."""
    return {_parameter(group, i): value for i, value in enumerate(values) if value != NOTHING} or None


def _joints(text: str) -> dict[str, Any] | None:
    kinds = {kind.lower(): kind for kind in JOINT_DESCRIPTIONS} | JOINT_NAMES
    text = re.sub(r"joint_\d+\s*[:=]", "", _NAMES_ALONE.sub("", text))
    text = re.sub(rf"\b([A-Za-z])\s*\((?:{'|'.join(kinds)})\)", r"\1", text, flags=re.IGNORECASE)  # Y (yaw)
    text = _in_brackets(text, _HAS_LETTER)
    types = re.findall(r"[A-Za-z]+", text)
    if len(types) == 1 and (types[0].isupper() or not set(types[0].lower()) - kinds.keys()):
        types = list(types[0])  # YPRP as one text
    if not types or not re.fullmatch(r"[\s,;|()\[\]{}$*_`\"'.>–-]*", re.sub(r"[A-Za-z]+", "", text)):
        return None
    if any(len(kind) > 1 and kind.lower() not in kinds for kind in types):
        return None
    return {_parameter("joints", i): kinds.get(kind.lower(), kind) for i, kind in enumerate(types)}


def _in_brackets(text: str, value: re.Pattern[str]) -> str:
    """Return the content of the only brackets with a value, or the text without brackets that hold none."""
    groups: list[str] = _BRACKETS.findall(text)
    with_values = [group for group in groups if value.search(group)]
    if len(with_values) == 1:
        return with_values[0]
    return _BRACKETS.sub(lambda match: match[0] if match[1] in with_values else "", text)


def _with_unit(number: str, unit: str) -> float | str:
    return float(number) if unit in ("", "m", "rad") else f"{number} {unit}"


def _parameter(group: str, index: int) -> str:
    if group == "origin" and index < len(AXES):
        return f"origin_{AXES[index]}"
    return f"{LISTS.get(group, group)}_{index + 1}"
