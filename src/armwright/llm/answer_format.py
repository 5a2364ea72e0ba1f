"""Designs written as lines: ORIGIN, JOINTS, LINKS and more, as a prompt asks for them in free text.

A line is read only where every word of it is understood; where numbers are mixed with other words, it is no value.
"""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

from armwright.spaces.joint_modules import JOINT_DESCRIPTIONS

AXES = ("x", "y", "z")
LISTS = {  # a value for each module, and what its parameters are called
    "joints": "joint", "links": "link", "motors": "motor", "directions": "direction", "strokes": "stroke",
    "ranges": "limit",
}  # fmt: skip
GROUPS = ("origin", "mount", *LISTS)
NOTHING = "-"  # stands in a list where a module has no such value
LONGEST_LINE = 2000  # characters; a longer one holds no values

_MINUS = str.maketrans({"−": "-", "﹣": "-", "-": "-", "＋": "+"})
_NUMBER = r"(?<![\w.])[-+]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|(?:nan|inf(?:inity)?)(?![A-Za-z]))"
_PLAIN = re.compile(_NUMBER, re.IGNORECASE)
_ITEM = re.compile(rf"({_NUMBER})[ ]?([A-Za-zµ°%]*)", re.IGNORECASE)
_NAMED = re.compile(rf"((?:origin|link|stroke|limit)_\w+)\s*[:=]\s*({_NUMBER})[ ]?([A-Za-zµ°%]*)", re.IGNORECASE)
_NAMES_ALONE = re.compile(
    r"\((?:(?:origin|link|joint|stroke|limit|direction|motor)_\w++|\.\.\.|…|[,\s])++\)\s*[:=]", re.IGNORECASE
)
_BRACKETS = re.compile(r"[(\[{]([^()\[\]{}]*)[)\]}]")
_LATEX = re.compile(r"\\(?:[A-Za-z]+|[,;:! ()\[\]])")
_LEFT_OVER = re.compile(r"[\s,;|()\[\]{}$*_`~≈\"'.]*")  # what may stand between values

_WORDS = "|".join([*(group.upper() for group in GROUPS), "EXPECTED", "REASON"])
# At the beginning of a line in any form of list or emphasis; in capitals, also further on in it.
_NAME = re.compile(
    rf"(?:^[ \t>*_#`|•–-]{{0,20}}(?:\d+[.)] ?)?[*_`]{{0,3}}(?P<first>(?i:{_WORDS}))"
    rf"|(?<=[\s;,])[*_`]{{0,3}}(?P<later>{_WORDS}))[ \t*_`]*[:=]",
    re.MULTILINE,
)


def module_lists(names: Collection[str]) -> dict[str, str]:
    """Return the lists of a space besides joints and links, each with the prefix of its parameters.

    Args:
        names: of the space's parameters.
    """
    return {group: kind for group, kind in LISTS.items() if group not in ("joints", "links") and f"{kind}_1" in names}


def designs_in_lines(text: str) -> tuple[int, list[dict[str, Any]]]:
    """The parameters of each design in the order of the text, and where the last one begins, or -1.

    A design begins with its ORIGIN, so that one that was not finished is not filled up from another.
    """
    designs: list[dict[str, Any]] = []
    last = -1
    for place, name, words in _named(text):
        values = _values(name, words) if len(words) <= LONGEST_LINE else None
        if values is None:
            continue
        if name == "origin":
            designs.append({})
            last = place
        if designs:
            for key, value in values.items():
                before = designs[-1].setdefault(key, value)
                if repr(before) != repr(value) and name in GROUPS:  # neither of the two, then
                    designs[-1][key] = f"{before} and {value}"
    return last, designs


def words_of_lists(content: Mapping[str, Any]) -> dict[str, Any]:
    """An object's values by parameter, where some are given together: "origin": [0, 0.1, 0], "joints": "YPRP"."""
    values: dict[str, Any] = {}
    for name, value in content.items():
        if name in GROUPS and isinstance(value, str):
            values.update(_values(name, value) or {name: value})
        elif name in GROUPS and isinstance(value, (list, tuple)):
            items: list[Any] = list(value)  # pyright: ignore[reportUnknownVariableType, reportUnknownArgumentType]
            values.update(
                {_parameter(name, place): item for place, item in enumerate(items) if item not in (None, NOTHING)}
            )
        else:
            values[name] = value
    return values


def plain_number(text: str, unit: str = "") -> float | None:
    """The number that a text is, with or without its unit; None where it is anything else."""
    text = text.strip().translate(_MINUS).removesuffix(unit).strip()
    return float(text) if _PLAIN.fullmatch(text) else None


def _named(text: str) -> Iterator[tuple[int, str, str]]:
    """Each name with its place and the words after it: of its line, or of the next where its own has none."""
    names = list(_NAME.finditer(text))
    ends = [*(match.start() for match in names[1:]), len(text)]
    for match, end in zip(names, ends, strict=False):  # without a name there is one end too many
        lines = text[match.end() : end].lstrip(" \t*_`").lstrip("\n").splitlines()
        yield match.start(), (match["first"] or match["later"]).lower(), lines[0] if lines else ""


def _values(name: str, words: str) -> dict[str, Any] | None:
    """The values by parameter; None for words that are no values."""
    if name == "reason":
        return {"reason": words.strip(" \t*_`")}
    words = _LATEX.sub(" ", words.translate(_MINUS))
    if name == "joints":
        return _joints(words)
    if name == "mount":
        found = re.findall(r"[A-Za-z]+(?:[-+][xy])?", words)
        return {"mount": found[0].lower()} if len(found) == 1 else None
    if name == "motors":
        names = re.findall(
            r"(?<!\S)-(?!\S)|[A-Za-z0-9][A-Za-z0-9._-]*", _spaced(re.sub(r"motor_\d+\s*[:=]", "", words))
        )
        return _listed(name, [motor.rstrip(".") for motor in names])
    if name == "directions":
        signed = re.findall(r"[-+] ?[xyzXYZ]", re.sub(r"direction_\d+\s*[:=]", "", words))
        return _listed(name, [direction.replace(" ", "").lower() for direction in signed])
    if name == "origin":
        words = re.sub(r"(?<!\w)([xyz])\s*[:=]", r"origin_\1 =", words)
    elif name == "links":
        words = re.sub(r"(?<!\w)[lL]_?(\d+)\s*[:=]", r"link_\1 =", words)
    named = _NAMED.findall(words)
    if named and name != "expected":
        rest = _LEFT_OVER.fullmatch(_NAMED.sub("", words))
        return {key.lower(): _with_unit(number, unit) for key, number, unit in named} if rest else None
    words = _in_brackets(_NAMES_ALONE.sub("", words), r"\d|nan|inf")
    if name in ("strokes", "ranges"):
        words = re.sub(r"(?<!\S)-(?!\S)", "nan", _spaced(words))
    if name == "expected":
        words = re.sub(r"[A-Za-z]\w*\s*[:=]", "", words)
    found = _ITEM.findall(words)
    if not found or not _LEFT_OVER.fullmatch(_ITEM.sub("", words)):
        return None
    if name == "expected":
        return {"expected": [float(number) for number, _ in found]}
    if name in ("strokes", "ranges"):
        return _listed(name, [NOTHING if number == "nan" else _with_unit(number, unit) for number, unit in found])
    return {_parameter(name, place): _with_unit(*item) for place, item in enumerate(found)}


def _spaced(words: str) -> str:
    """With blanks around what separates the values of a list."""
    return re.sub(r"[,;|()\[\]{}]", " ", words)


def _listed(group: str, values: Sequence[Any]) -> dict[str, Any] | None:
    """The values by parameter, those left out that a module does not have."""
    listed = {_parameter(group, place): value for place, value in enumerate(values) if value != NOTHING}
    return listed or None


def _joints(words: str) -> dict[str, Any] | None:
    spoken = {kind.lower(): kind for kind in JOINT_DESCRIPTIONS} | {
        w.partition(",")[0]: k for k, w in JOINT_DESCRIPTIONS.items()
    }
    words = re.sub(r"joint_\d+\s*[:=]", "", _NAMES_ALONE.sub("", words))
    words = re.sub(rf"\b([A-Za-z])\s*\((?:{'|'.join(spoken)})\)", r"\1", words, flags=re.IGNORECASE)  # Y (yaw)
    words = _in_brackets(words, r"[A-Za-z]")
    types = re.findall(r"[A-Za-z]+", words)
    if len(types) == 1 and (types[0].isupper() or not set(types[0].lower()) - spoken.keys()):
        types = list(types[0])  # YPRP as one word
    if not types or not re.fullmatch(r"[\s,;|()\[\]{}$*_`\"'.>–-]*", re.sub(r"[A-Za-z]+", "", words)):
        return None
    if any(len(kind) > 1 and kind.lower() not in spoken for kind in types):
        return None
    return {_parameter("joints", place): spoken.get(kind.lower(), kind) for place, kind in enumerate(types)}


def _in_brackets(words: str, value: str) -> str:
    """What the only brackets with a value in them hold, else all without the brackets that hold none."""
    groups: list[str] = _BRACKETS.findall(words)
    with_values = [group for group in groups if re.search(value, group, re.IGNORECASE)]
    if len(with_values) == 1:
        return with_values[0]
    return _BRACKETS.sub(lambda match: match[0] if match[1] in with_values else "", words)


def _with_unit(number: str, unit: str) -> float | str:
    return float(number) if unit in ("", "m", "rad") else f"{number} {unit}"


def _parameter(group: str, place: int) -> str:
    if group == "origin":
        return f"origin_{AXES[place]}" if place < len(AXES) else f"origin_{place + 1}"
    return f"{LISTS.get(group, group)}_{place + 1}"
