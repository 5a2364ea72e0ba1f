"""Mutated documents: the short form of `make fuzz`."""

from random import Random

import pytest

from tests.fuzz.__main__ import limited
from tests.fuzz.target import check, seeds_of
from tests.fuzz.targets import TARGETS


@pytest.mark.parametrize("name", TARGETS)
def test_mutated_documents_are_read_or_refused(name: str) -> None:
    """Some inputs each, for about half a second; the unchanged documents are valid, or little code would be reached."""
    target = TARGETS[name]
    for number in range(min(100, max(4, target.inputs // 1000))):
        with limited():
            check(target, target.make(Random(number)))
    seeds = seeds_of(target)
    assert sum(check(target, one) for one in seeds) >= 0.7 * len(seeds)  # some command lines are wrong on purpose
