"""The choice of a proposer, and options it refuses."""

from pathlib import Path
from typing import Any

import pytest

from armwright.exceptions import ReplayError, SettingsError
from armwright.llm.model_options import ModelOptions
from armwright.proposers.factory import choose_proposer


@pytest.mark.parametrize("name", ["rules", "none", "auto", "replay:x", "manual:x"])
@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("prompt", "minus"),
        ("memory", "none"),
        ("answer", "two-step"),
        ("temperature", 0.0),
        ("seed", 0),
        ("output", "auto"),
        ("origin", "model"),
        ("in_flight", 1),
        ("max_calls", 1),
        ("max_cost", 1.0),
        ("on_failure", "stop"),
        ("replay_strict", False),
        ("wait", True),
    ],
)
def test_option_without_effect_is_refused(tmp_path: Path, name: str, option: str, value: Any) -> None:
    """This holds even if it states the default."""
    chosen, options = name.replace("x", str(tmp_path / "x")), ModelOptions(**{option: value})
    if name == "manual:x" and option in ("prompt", "memory", "wait"):
        assert choose_proposer(chosen, options).proposer is not None
    elif name == "replay:x" and option in ("in_flight", "replay_strict"):
        with pytest.raises(ReplayError, match="to replay"):
            choose_proposer(chosen, options)
    else:
        with pytest.raises(SettingsError, match=f"{option} = {value}"):
            choose_proposer(chosen, options)
