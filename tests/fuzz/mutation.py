"""Mutate valid documents: replace values by hostile ones and damage bytes."""

import copy
import json
from collections.abc import Iterator
from functools import lru_cache
from random import Random
from typing import Any

import yaml

LARGEST = 200_000  # [bytes] of an input; larger ones are tests of their own

# Each broke some program once.
NUMBERS: tuple[Any, ...] = (
    0, -1, 1, 2, 8, 9, 100, 101, 10_001, 2**31, 2**63, 10**30, 10**4299, -(10**400), 0.0, -0.0, 1e-320, 1e-9, 0.1, 0.5,
    1.0, 1000.0, 1001.0, 1e16, 1e38, 1e39, 1e308, -1e308, float("inf"), float("-inf"), float("nan"), True, False, None,
)  # fmt: skip
TEXTS = (
    "", " ", "\n", "a\nb", "\0", "\x1b[2J", "\u202e", "\ufeff", "é\u0301", "\U0001f9be", "😀" * 50, "x" * 70,
    "x" * 5000, "\ud800", "\udc80", "../../x", "/etc/passwd", "C:\\x", "CON", "nul.yaml", "..", ".", "~", "a/b",
    "x\ny.yaml", "<script>alert(1)</script>", "</script>", "&lt;", '"', "'", "`id`", "$(id)", "; rm -rf x", "%s%n",
    "{0.__class__}", "{{ 7 * 7 }}", "{% for i in range(10**9) %}{% endfor %}", "${1+1}", "$(eval 1)",
    "__import__('os').system('id')", "nan", "inf", "-inf", "1e309", "1e999999", "0x10", "1_0", "1:30", "1:1:1.0", "12e",
    "１２", "true", "no", "null", "2001-01-01", "2001-02-30", "=", "<<", "!!python/object/apply:os.system [id]", "&a",
    "*a", "mass <= 3", "mass<=1e999", "replay:x", "manual:..", "http://127.0.0.1:1/", "openai-chat:x", "llm-0001",
    "llm-", "-", "--", "-1", "R", "YPRP",
)  # fmt: skip
# Spliced into the bytes of a document.
TOKENS = (
    b"\0", b"\xff", b"\xfe\xff", b"\xed\xa0\x80", b"\xef\xbb\xbf", b"\r", b"\n", b"\t", b"\x1b", b"{", b"}", b"[",
    b"]", b":", b",", b"-", b"- ", b"? ", b"&a ", b"*a", b"!!int ", b"!!float ", b"!!bool ", b"!!timestamp ",
    b"!!binary ", b"!!set ", b"!!omap ", b"!!pairs ", b"!!null ", b"!!str ", b"!!python/tuple ", b"! ", b"!x ",
    b"%YAML 1.1\n", b"%TAG ! x\n", b"---\n", b"...\n", b"<<: ", b"| ", b"> ", b"'", b'"', b"\\", b"\\u0000",
    b"\\ud800", b"#", b"=", b"0x", b"1e999", b"NaN", b"Infinity", b"-Infinity", b"null", b"true", b"9" * 400,
    b"9" * 5000, b"1:" * 300 + b"1.0", b"[" * 300, b"{" * 300, b"- " * 300, b'{"a":' * 300, b"a" * 2000, b"<", b">",
    b"&amp;", b"&#0;", b"&#xd800;", b"&x;", b"<!DOCTYPE a [<!ENTITY x 'y'>]>",
    b"<!DOCTYPE a SYSTEM 'file:///etc/passwd'>", b"<![CDATA[", b"]]>", b"<!--", b"-->",
    b"<?xml version='1.0' encoding='utf-7'?>", b"<?xml version='1.1' encoding='x'?>", b"<a>" * 60, b"${", b"}", b"$(",
    b"{{", b"}}", b"{%", b"%}", b"```\n", b"TASK\n", b"SPACE\n", b"ORIGIN: ", b"JOINTS: ", b"LINKS: ", b"<think>",
    b"</think>",
)  # fmt: skip


def mutated(content: Any, rng: Random) -> Any:
    """A copy of JSON-like data with one to four of its places changed."""
    content = copy.deepcopy(content)
    for _ in range(rng.choice((1, 1, 1, 2, 2, 3, 4))):
        content = _changed(content, rng)
    return content


def hostile(rng: Random) -> Any:
    """A value that no document should hold, or a good one out of its place."""
    kind = rng.randrange(10)
    if kind < 4:
        return rng.choice(NUMBERS)
    if kind < 8:
        return rng.choice(TEXTS)
    if kind == 8:
        return [hostile(rng) for _ in range(rng.choice((0, 1, 2, 3, 3, 4, 9)))]
    return _nested(rng) if rng.randrange(4) == 0 else {str(rng.choice(TEXTS)): hostile(rng)}


def _nested(rng: Random) -> Any:
    value: Any = rng.choice((1, "x", []))
    for _ in range(rng.choice((3, 30, 300))):
        value = [value] if rng.randrange(2) else {"a": value}
    return value


def _changed(content: Any, rng: Random) -> Any:
    places = list(_places(content))
    if not places:
        return hostile(rng)
    holder, key = rng.choice(places)
    kind = rng.randrange(12)
    if kind < 5:
        holder[key] = hostile(rng)
    elif kind == 5:
        holder[key] = _near(holder[key], rng)
    elif kind == 6:
        del holder[key]
    elif kind == 7:  # another place's value
        other, at = rng.choice(places)
        holder[key] = copy.deepcopy(other[at])
    elif kind == 8:
        holder[key] = [copy.deepcopy(holder[key])] if rng.randrange(2) else {str(key): copy.deepcopy(holder[key])}
    elif kind == 9 and isinstance(holder, list):
        times = rng.choice((1, 2, 7, 60))
        holder[key:key] = [copy.deepcopy(holder[key]) for _ in range(times if len(str(holder)) < 2000 else 1)]
    elif isinstance(holder, dict):
        name = rng.choice((str(rng.choice(TEXTS)), f"{key}x", str(key).upper(), f"{key}_9"))
        holder[name] = holder.pop(key) if rng.randrange(2) else hostile(rng)
    else:
        rng.shuffle(holder)
    return content


def _near(value: Any, rng: Random) -> Any:
    """A value of the same kind."""
    if isinstance(value, bool) or value is None:
        return not value
    if isinstance(value, int):
        return value + rng.choice((-1, 1, 10, 10**6))
    if isinstance(value, float):
        return value * rng.choice((-1.0, 0.0, 1.0 + 1e-12, 10.0, 1e-9, 1e9))
    if isinstance(value, str):
        return rng.choice((f"{value}{value}", value[:-1], value.upper(), f" {value}", f"{value}\n", value[::-1]))
    return [value]


def _places(content: Any) -> Iterator[tuple[Any, Any]]:
    """Every place of a tree that can be written to; trees are walked without recursion, as they may be deep."""
    waiting = [content]
    while waiting:
        node = waiting.pop()
        if isinstance(node, dict):
            keys: Any = list(node)
        elif isinstance(node, list):
            keys = range(len(node))
        else:
            continue
        for key in keys:
            yield node, key
            waiting.append(node[key])


def garbled(data: bytes, rng: Random) -> bytes:
    """Bytes with one to four of their places damaged."""
    for _ in range(rng.choice((1, 1, 2, 4))):
        at, end = sorted(rng.randrange(len(data) + 1) for _ in range(2)) if data else (0, 0)
        end = min(end, at + rng.choice((1, 2, 8, 64, 4096)))
        kind = rng.randrange(6)
        if kind < 3:
            piece = rng.choice(TOKENS)
            data = data[:at] + piece + data[at if kind else end :]
        elif kind == 3:
            data = data[:at] + data[end:]
        elif kind == 4:
            data = data[:at] + data[at:end] * rng.choice((2, 3, 30)) + data[end:]
        else:
            data = data[:at] + bytes([rng.randrange(256)]) + data[at + 1 :]
    return data[:LARGEST]


@lru_cache(maxsize=100)
def _content(data: bytes, form: str) -> Any:
    return json.loads(data) if form == "json" else yaml.load(data, Loader=yaml.CSafeLoader)


def _written(content: Any, form: str) -> bytes:
    if form == "yaml":
        try:
            return yaml.dump(content, Dumper=yaml.CSafeDumper, allow_unicode=True, sort_keys=False, encoding="utf-8")
        except (RecursionError, ValueError):  # such as a lone surrogate, which JSON has a form for
            pass
    try:
        return json.dumps(content).encode()
    except (RecursionError, ValueError):  # a number of too many digits
        return b"[" * 500


def changed(data: bytes, form: str, rng: Random) -> bytes:
    """A document changed in its structure, where it has one that can be read, or in its bytes."""
    if form == "jsonl":
        return _changed_lines(data, rng)
    if form == "text" or not rng.randrange(4):
        return garbled(data, rng)
    try:
        data = _written(mutated(_content(data, form), rng), form)[:LARGEST]
    except Exception:  # noqa: BLE001 (whatever an earlier change has made of it)
        return garbled(data, rng)
    return data if rng.randrange(4) else garbled(data, rng)


def _changed_lines(data: bytes, rng: Random) -> bytes:
    lines = data.split(b"\n")
    at = rng.randrange(len(lines))
    kind = rng.randrange(10)
    if kind < 7:
        lines[at] = changed(lines[at], "json", rng)
    elif kind == 7:
        rng.shuffle(lines)
    elif kind == 8:
        lines.insert(at, rng.choice(lines))
    else:
        del lines[at]
    return b"\n".join(lines)[:LARGEST]
