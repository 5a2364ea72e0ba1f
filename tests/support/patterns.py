"""Regular expressions of the package, and whether their matching time may grow faster than the text."""

import ast
import importlib
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from re import _constants as codes  # pyright: ignore[reportAttributeAccessIssue]
from re import _parser as parser  # pyright: ignore[reportAttributeAccessIssue]
from typing import Any

import armwright

ROOT = Path(armwright.__file__).parent
SEARCHES = {"search", "sub", "subn", "findall", "finditer", "split"}
WHOLE = {"match", "fullmatch"}
MOST = 64  # a repetition up to this many times counts as bounded
LETTERS = frozenset(map(chr, range(128))) | frozenset("é…µ°–×≈ß²\u2028\xa0")
_REPEATS = {codes.MAX_REPEAT: False, codes.MIN_REPEAT: False, codes.POSSESSIVE_REPEAT: True}


@dataclass(frozen=True)
class Pattern:
    """A regular expression, and whether it is searched for anywhere in a text."""

    place: str
    text: str
    flags: int
    searches: bool


@dataclass(frozen=True)
class Atom:
    """Letters that may be repeated, or what must hold between two letters: before, after or at a word's end."""

    letters: frozenset[str]
    least: int = 1
    is_unbounded: bool = False
    is_possessive: bool = False
    is_required: bool = True  # for a match
    guard: str = ""  # "never inside": a match cannot begin, or "end": it must hold for a match


def patterns() -> Iterator[Pattern]:
    """Every pattern in the package's Python files."""
    for file in sorted(ROOT.rglob("*.py")):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        name = ".".join(("armwright", *file.relative_to(ROOT).with_suffix("").parts))
        uses: dict[str, set[str]] = {}
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                uses.setdefault(node.value.id, set()).add(node.attr)
        assigned = {
            id(node.value): node.targets[0].id
            for node in ast.walk(tree)
            if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
        }
        for node in ast.walk(tree):
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.args):
                continue
            function = node.func.attr
            if not (isinstance(node.func.value, ast.Name) and node.func.value.id == "re"):
                continue
            if function not in SEARCHES | WHOLE | {"compile"}:
                continue
            how = {function} if function != "compile" else uses.get(assigned.get(id(node), ""), SEARCHES)
            module = vars(importlib.import_module(name)) if name != "armwright.__main__" else {}
            flags = _flags(node, module)
            yield Pattern(
                f"{file.relative_to(ROOT)}:{node.lineno}", _text(node.args[0], module), flags, not how <= WHOLE
            )


def _text(node: ast.expr, module: dict[str, Any]) -> str:
    """A pattern as it is written; what only a run knows is a letter."""
    if isinstance(node, ast.Constant):
        return str(node.value)
    if isinstance(node, ast.Name):
        return str(module[node.id])
    if isinstance(node, ast.JoinedStr):
        return "".join(_text(part, module) for part in node.values)
    if isinstance(node, ast.FormattedValue):
        value = module.get(node.value.id) if isinstance(node.value, ast.Name) else None
        return value if isinstance(value, str) else "a"
    if isinstance(node, ast.IfExp):  # each of them is tried by the other's sake
        return f"(?:{_text(node.body, module)}|{_text(node.orelse, module)})"
    raise AssertionError(f"a pattern that this test cannot read: {ast.unparse(node)}")


def _flags(node: ast.Call, module: dict[str, Any]) -> int:
    given = [k.value for k in node.keywords if k.arg == "flags"] + node.args[1:]
    names = [n.attr for value in given for n in ast.walk(value) if isinstance(n, ast.Attribute)]
    flags = [flag for name in names if isinstance(flag := getattr(re, name, None), re.RegexFlag)]
    return sum(set(map(int, flags)))


def faults(pattern: Pattern) -> list[str]:
    """Why the time to match may grow faster than the text; empty if it does not."""
    tree = parser.parse(pattern.text, pattern.flags)
    return sorted({fault for path in _paths(tree, tree.state.flags) for fault in _faults(path, pattern.searches)})


def _faults(path: tuple[Atom, ...], searches: bool) -> Iterator[str]:
    for i, atom in enumerate(path):
        if not atom.is_unbounded:
            continue
        for other in path[i + 1 :] if not atom.is_possessive else ():
            if other.is_unbounded and atom.letters & other.letters:
                yield f"two repetitions share {_some(atom.letters & other.letters)}"
            if other.guard == "" and other.least and not atom.letters & other.letters:
                break
        is_required_after = any(other.is_required and (other.least or other.guard == "end") for other in path[i + 1 :])
        if searches and is_required_after and _restarts(path[:i], atom):
            yield f"a search begins again at every letter of a run of {_some(atom.letters)}"


def _restarts(before: tuple[Atom, ...], run: Atom) -> bool:
    """Whether a match may begin within the run of a repetition."""
    for atom in before:
        if atom.guard:
            if run.letters <= atom.letters:
                return False
        elif atom.least and not atom.letters & run.letters:
            return False
    return True


def _some(letters: frozenset[str]) -> str:
    return repr("".join(sorted(letters))[:8])


def _paths(nodes: Any, flags: int) -> list[tuple[Atom, ...]]:
    """Every way through a pattern, without the number of repetitions."""
    parts = [_node_paths(code, value, flags) for code, value in nodes]
    found = [tuple(atom for part in way for atom in part) for way in product(*parts)]
    assert len(found) < 20_000, "too many ways through a pattern"
    return list(dict.fromkeys(found))


def _node_paths(code: Any, value: Any, flags: int) -> list[tuple[Atom, ...]]:
    if code in _REPEATS:
        return _repeat_paths(_REPEATS[code], *value, flags)
    if code is codes.SUBPATTERN:
        return _paths(value[3], (flags | value[1]) & ~value[2])
    if code is codes.ATOMIC_GROUP:
        return [tuple(replace(atom, is_possessive=True) for atom in path) for path in _paths(value, flags)]
    if code is codes.BRANCH:
        return [path for branch in value[1] for path in _paths(branch, flags)]
    if code in (codes.ASSERT, codes.ASSERT_NOT):
        return _look_around(code, value, flags)
    if code is codes.AT:
        return [(_anchor(value, flags),)]
    return [(Atom(_letters(code, value, flags)),)]


def _repeat_paths(is_possessive: bool, least: int, most: Any, body: Any, flags: int) -> list[tuple[Atom, ...]]:
    is_unbounded = most is codes.MAXREPEAT or most > MOST
    inner = _paths(body, flags)
    single = len(body) == 1 and all(len(path) == 1 and not path[0].is_unbounded for path in inner)
    if single:
        letters = frozenset().union(*(path[0].letters for path in inner))
        return [(Atom(letters, least, is_unbounded, is_possessive),)]
    ways = [(*first, *second) for first in inner for second in inner] if is_unbounded else inner
    if is_possessive:
        ways = [tuple(replace(atom, is_possessive=True) for atom in way) for way in ways]
    if is_unbounded:  # the whole is a run, too
        letters = frozenset().union(*(atom.letters for path in inner for atom in path))
        ways = [*ways, (Atom(letters, least, True, is_possessive),)]
    return ways if least else [(), *(tuple(replace(atom, is_required=False) for atom in way) for way in ways)]


def _look_around(code: Any, value: Any, flags: int) -> list[tuple[Atom, ...]]:
    direction, body = value
    paths = _paths(body, flags)
    if direction > 0:  # looked at after what was matched, as if it were part of it
        may_fail = code is codes.ASSERT_NOT or all(any(atom.least for atom in path) for path in paths)
        return [(*path, *([Atom(frozenset(), 0, guard="end")] if may_fail else ())) for path in paths]
    letters = frozenset().union(*(atom.letters for path in paths for atom in path))
    return [(Atom(letters if code is codes.ASSERT_NOT else LETTERS - letters, 0, guard="never inside"),)]


def _anchor(value: Any, flags: int) -> Atom:
    if value is codes.AT_BEGINNING_STRING or (value is codes.AT_BEGINNING and not flags & re.MULTILINE):
        return Atom(LETTERS, 0, guard="never inside")
    if value is codes.AT_BEGINNING:
        return Atom(LETTERS - {"\n"}, 0, guard="never inside")
    if value is codes.AT_BOUNDARY:
        return Atom(frozenset(letter for letter in LETTERS if re.match(r"\w", letter)), 0, guard="never inside")
    return Atom(frozenset(), 0, guard="end")


def _letters(code: Any, value: Any, flags: int) -> frozenset[str]:
    """The letters that a node for one of them matches."""
    if code is codes.ANY:
        return LETTERS if flags & re.DOTALL else LETTERS - {"\n"}
    if code is codes.LITERAL or code is codes.NOT_LITERAL:
        same = {chr(value)} | ({chr(value).lower(), chr(value).upper()} if flags & re.IGNORECASE else set())
        return frozenset(same) if code is codes.LITERAL else LETTERS - same
    if code is codes.IN:
        items, negated = list(value), value[0][0] is codes.NEGATE
        found = frozenset().union(*(_letters(*item, flags) for item in items[negated:]))
        return LETTERS - found if negated else found
    if code is codes.RANGE:
        low, high = value
        found = {letter for letter in LETTERS if low <= ord(letter) <= high}
        if flags & re.IGNORECASE:
            found |= {c for letter in found for c in (letter.lower(), letter.upper())}
        return frozenset(found) | {chr(low)}
    if code is codes.CATEGORY:
        written = {
            codes.CATEGORY_DIGIT: r"\d", codes.CATEGORY_NOT_DIGIT: r"\D", codes.CATEGORY_SPACE: r"\s",
            codes.CATEGORY_NOT_SPACE: r"\S", codes.CATEGORY_WORD: r"\w", codes.CATEGORY_NOT_WORD: r"\W",
        }[value]  # fmt: skip
        return frozenset(letter for letter in LETTERS if re.match(written, letter))
    raise AssertionError(f"a part of a pattern that this test does not know: {code}")


def classes(pattern: Pattern) -> list[str]:
    """One letter for each set of letters that the pattern tells apart, and one that is in none."""
    sets: set[frozenset[str]] = set()
    for path in _paths(parser.parse(pattern.text, pattern.flags), pattern.flags):
        sets |= {atom.letters for atom in path if atom.letters}
    kinds: dict[tuple[bool, ...], str] = {}
    for letter in sorted(LETTERS, key=lambda c: (not c.isprintable(), c)):
        kinds.setdefault(tuple(letter in one for one in sets), letter)
    return list(kinds.values())


def example(pattern: Pattern) -> str:
    """A text that the longest way through a pattern nearly matches."""
    path = max(_paths(parser.parse(pattern.text, pattern.flags), pattern.flags), key=len)
    return "".join(min(atom.letters, key=lambda c: (not c.isalnum(), c)) for atom in path if not atom.guard)
