"""Which proposer a run gets, and what has no use with it."""

from pathlib import Path
from typing import Any

import pytest

from armwright.exceptions import ReplayError, SettingsError
from armwright.proposers.factory import Wishes, choose_proposer


@pytest.mark.parametrize("name", ["rules", "none", "auto", "replay:x", "manual:x"])
@pytest.mark.parametrize(
    ("said", "value"),
    [
        ("prompt", "minus"),
        ("memory", "none"),
        ("answer", "two-step"),
        ("proposals", 1),
        ("temperature", 0.0),
        ("model_seed", 0),
        ("output", "auto"),
        ("origin", "model"),
        ("max_calls", 0),
        ("max_cost", 0.0),
    ],
)
def test_an_option_that_has_no_use_is_refused(tmp_path: Path, name: str, said: str, value: Any) -> None:
    """Also where it says what would be so by itself."""
    wishes = Wishes(name.replace("x", str(tmp_path / "x")), **{said: value})
    if name == "manual:x" and said in ("prompt", "memory", "proposals"):
        assert choose_proposer(wishes).proposer is not None
    elif name == "replay:x" and said in ("prompt", "memory", "answer", "proposals"):  # checked against the record
        with pytest.raises(ReplayError, match="to replay"):
            choose_proposer(wishes)
    else:
        with pytest.raises(SettingsError, match=f"--{said.replace('_', '-')} {value}"):
            choose_proposer(wishes)
