"""`armwright optimize --print-prompt` prints exactly the first prompt that is sent."""

from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from armwright import Problem, load_task, optimize
from armwright.cli.app import app
from armwright.exceptions import ArmwrightError
from tests.support.chat_server import ChatServer
from tests.support.controlled_runs import calls
from tests.support.wire_formats import llm_proposer, model_options


def shown(*args: str) -> tuple[str, str]:
    """What the command prints for a program, and for a person."""
    result = CliRunner().invoke(app, ["optimize", "--print-prompt", *args])
    if isinstance(result.exception, ArmwrightError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.stdout, result.stderr


@pytest.mark.parametrize("how", [{"prompt": "minus"}, {"answer": "one-step"}, {"memory": "chat"}])
def test_printed_prompt_is_the_prompt_sent(chat_server: ChatServer, tmp_path: Path, how: dict[str, Any]) -> None:
    options = ("target-1", "--n-init", "4", "--seed", "5", *model_options(**how))
    prompt, words = shown(*options)
    assert words.startswith("about ")
    assert words.endswith("tokens; for trial 4\n")
    problem, proposer = Problem(load_task("target-1")), llm_proposer(chat_server.url, **how)
    optimize(problem, proposer=proposer, n_init=4, n_total=1, seed=5, out=tmp_path / "run", verify=False)
    asked = [call.prompt for call in calls(tmp_path / "run") if call.step in ("reasoning", "answer")]
    assert asked == [prompt]


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["target-9"], 'unknown task "target-9"'),
        (["target-1", *model_options(memory="all")], 'memory: expected none or chat, got "all"'),
    ],
)
def test_invalid_arguments_are_refused(args: list[str], message: str) -> None:
    with pytest.raises(ArmwrightError) as refusal:
        shown(*args)
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)
