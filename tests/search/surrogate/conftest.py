"""Choices among few candidates, which take less time."""

import pytest

from armwright.search.surrogate import candidates


@pytest.fixture(autouse=True)
def _few_candidates(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(candidates, "RANDOM", 100)
    monkeypatch.setattr(candidates, "NEAR_FRONT", 50)
    monkeypatch.setattr(candidates, "FRONT_EVALUATIONS", 600)
