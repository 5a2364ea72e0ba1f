"""No regular expression of the package takes more than linear time, whatever text it is given."""

import json
import subprocess
import sys
from itertools import product

import pytest

from armwright.units import read_quantity
from tests.support.patterns import Pattern, classes, example, faults, patterns

ALL = sorted({(p.text, p.flags, p.searches): p for p in patterns()}.values(), key=lambda p: p.place)
SECONDS = 30.0
LETTERS = 100_000
MATCH = """
import json, re, sys
text, flags, searches, units, ends, n = json.load(sys.stdin)
pattern = re.compile(text, flags)
for unit in units:
    for end in ends if len(unit) == 1 else ends[:2]:
        long = unit * (n // len(unit)) + end
        list(pattern.finditer(long)) if searches else pattern.fullmatch(long)
"""


def test_patterns_are_found() -> None:
    assert len(ALL) > 50
    assert any(p.place.startswith("llm/redaction.py") and "*" in p.text for p in ALL)


@pytest.mark.parametrize("pattern", ALL, ids=lambda p: p.place)
def test_pattern_has_no_repetitions_that_share_letters(pattern: Pattern) -> None:
    assert not faults(pattern), pattern.text


@pytest.mark.slow
@pytest.mark.parametrize("pattern", ALL, ids=lambda p: p.place)
def test_pattern_reads_long_repetitions_in_time(pattern: Pattern) -> None:
    """Repetitions of all letters and pairs of letters that the pattern tells apart, with a near match at the end."""
    assert reads_in_time(pattern)


def reads_in_time(pattern: Pattern, seconds: float = SECONDS) -> bool:
    """Whether a process of its own reads all that is hard for the pattern."""
    letters, near = classes(pattern), example(pattern)
    pairs = sorted({a + b if a != b else a for a, b in product(letters, letters)})
    units, ends = [*pairs, near, near[:-1] or near], [near[:-1], "\0", *letters]
    given = json.dumps([pattern.text, pattern.flags, pattern.searches, units, ends, LETTERS])
    command = [sys.executable, "-I", "-c", MATCH]
    try:
        subprocess.run(command, input=given, encoding="utf-8", timeout=seconds, check=True)
    except subprocess.TimeoutExpired:
        return False
    return True


@pytest.mark.parametrize("text", ["1" * 100_000 + "\n x", " " * 100_000 + "1 x", "1" + " " * 100_000 + "\nx"])
def test_long_quantities_are_read_at_once(text: str) -> None:
    assert read_quantity(text, "m") is None
