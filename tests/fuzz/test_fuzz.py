"""Give mutated documents to every entry point; `make fuzz` gives more than the short form does."""

import resource
from pathlib import Path
from random import Random

import pytest

from tests.fuzz.target import check, limited, seeds_of
from tests.fuzz.targets import TARGETS

FOUND = Path("fuzz-found")
LARGEST = 1.5  # [GiB] of a process


@pytest.mark.parametrize("name", TARGETS)
def test_mutated_documents_are_read_or_refused(name: str, pytestconfig: pytest.Config) -> None:
    """The unchanged documents are valid, or little code would be reached; some command lines are wrong on purpose."""
    target, share = TARGETS[name], pytestconfig.getoption("--fuzz")
    short = min(100, max(4, target.inputs // 1000))  # some half a second
    for number in range(max(1, round(share * target.inputs)) if share else short):
        data = target.make(Random(number))
        try:
            with limited():
                check(target, data)
        except BaseException:
            FOUND.mkdir(exist_ok=True)
            (FOUND / f"{name.replace(' ', '-')}-{number}").write_bytes(data)
            raise
    seeds = seeds_of(target)
    assert sum(check(target, one) for one in seeds) >= 0.7 * len(seeds)
    if share:
        assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20 < LARGEST
