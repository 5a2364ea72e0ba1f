"""Mutated documents: the short form of `make fuzz`."""

from random import Random

import hypothesis
import pytest
from hypothesis import strategies

from tests.fuzz.__main__ import limited
from tests.fuzz.target import check, seeds_of
from tests.fuzz.targets import TARGETS


def inputs(name: str) -> int:
    """Return a number of inputs that takes about half a second."""
    if name.startswith("run ") or name == "draft":
        return 4
    return 20 if TARGETS[name].heavy else 100


@pytest.mark.parametrize("name", TARGETS)
def test_mutated_documents_are_read_or_refused(name: str) -> None:
    target = TARGETS[name]

    @hypothesis.settings(
        max_examples=inputs(name), derandomize=True, database=None, deadline=None,
        suppress_health_check=list(hypothesis.HealthCheck),
    )  # fmt: skip
    @hypothesis.given(strategies.randoms(use_true_random=False))
    def fuzz(rng: Random) -> None:
        with limited():
            check(target, target.make(rng))

    fuzz()


@pytest.mark.parametrize("name", TARGETS)
def test_seed_documents_are_valid(name: str) -> None:
    """Otherwise the fuzzer would reach little code. Some command lines are wrong on purpose."""
    seeds = seeds_of(TARGETS[name])
    passed = [check(TARGETS[name], one) for one in seeds]
    assert sum(passed) >= 0.7 * len(seeds)
