"""The choice of a proposer, and options it refuses."""

from pathlib import Path
from typing import Any

import pytest

from armwright.exceptions import ReplayError, SettingsError
from armwright.llm.model_options import ModelOptions
from armwright.proposers.factory import choose_proposer

OPTIONS: dict[str, Any] = {
    "prompt": "minus",
    "memory": "none",
    "answer": "two-step",
    "output": "auto",
    "origin": "model",
    "temperature": 0.0,
    "seed": 0,
    "in_flight": 1,
    "max_calls": 1,
    "max_cost": 1.0,
}


@pytest.mark.parametrize("name", ["rules", "none", "auto", "replay:x", "manual:x"])
@pytest.mark.parametrize("option", OPTIONS)
def test_option_without_effect_is_refused(tmp_path: Path, name: str, option: str) -> None:
    """This holds even if it states the default."""
    chosen, options = name.replace("x", str(tmp_path / "x")), ModelOptions(**{option: OPTIONS[option]})
    if name == "manual:x" and option in ("prompt", "memory"):
        assert choose_proposer(chosen, options).proposer is not None
    elif name == "replay:x" and option == "in_flight":
        with pytest.raises(ReplayError, match="to replay"):
            choose_proposer(chosen, options)
    else:
        with pytest.raises(SettingsError, match=f"{option} = {OPTIONS[option]}"):
            choose_proposer(chosen, options)
