"""Fuzz command lines, in this process."""

import io
import json
import os
import shutil
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

from armwright.exceptions import ArmwrightError, RunFolderError
from tests.fuzz.run_targets import a_run
from tests.fuzz.target import DefectError, folder
from tests.fuzz.text_targets import POINTS, urdf_seeds


def argument_seeds() -> list[bytes]:
    run = str(a_run())
    lines = (
        ["tasks", "target-1"], ["tasks", "--json"], ["optimize", "target-1", "--n-total", "2", "--n-init", "1"],
        ["optimize", "target-1", "--sampler", "random", "--objectives", "torque,mass", "--robust", "--seed", "3"],
        ["optimize", "target-1", "--proposer", "rules", "--n-step", "2", "--json"],
        ["optimize", "target-1", "--proposer", f"replay:{run}"],
        ["optimize", "target-1", "--proposer", "manual:desk", "--prompt", "minus", "--model-options",
         "{wait: false, memory: chat}"],
        ["optimize", "target-1", "--model", "openai-chat:x", "--max-cost", "0.5", "--model-options",
         "{base_url: 'http://127.0.0.1:9', max_calls: 3, temperature: 0, seed: 1, answer: one-step, output: native}"],
        ["optimize", "target-1", "--print-prompt", "next", "--model-options", "{answer: one-step}", "--n-init", "3"],
        ["optimize", "target-1", "--print-prompt", "schema"],
        ["design", "target-1", "--evaluations", "100", "--no-stall", "--seed", "1"],
        ["experiment", "paper", "--seeds", "1", "--task", "target-1", "--method", "bbo", "--print"],
        ["experiment", "rules", "--print"], ["compare", run, "--baseline", "BBO"],
        ["compare-arms", "target-1", "arm.urdf", "--base", "0,0,0.5", "--tip", "tip", "--base-link", "base"],
        ["pick", run, "--where", "torque<=9", "--by", "mass", "-n", "2"], ["pick", run, "--weights", "torque=1"],
        ["export", run, "--design", "2", "--format", "mjcf", "--out", "x/y.xml"], ["report", run],
        ["actuators"], ["doctor", "--model", "openai-chat:x"], ["check", "target-1", "--json"],
        ["draft", "words", "--print-prompt"], ["init", "new.yaml", "--from", "points.csv", "--unit", "mm"],
        ["init", "new.yaml", "--offset", "0", "0", "1"], ["--version"], ["--help"],
    )  # fmt: skip
    return [json.dumps(line).encode() for line in lines]


SHORT = {
    "optimize": ["--n-init=1", "--n-total=2"],
    "design": ["--evaluations=50"],
    "experiment": ["--print"],
}
NEVER = ("--live", "--call", "--scheduler", "--workers")  # these wait for others or start processes


def run_arguments(data: bytes) -> None:
    """Run a command line in this process; searches run for a few trials."""
    from armwright.cli.app import app

    try:
        content = json.loads(data)
    except (ValueError, RecursionError):
        content = ["tasks", data.decode("utf-8", "replace")]
    listed = content if isinstance(content, list) else [content]
    given = [_argument(one) for one in listed][:40]
    if any(one.partition("=")[0] in NEVER or "--figures".startswith(one) for one in given if one) or (
        given and given[0] == "report"
    ):
        return
    if given and given[0] in ("optimize", "design", "experiment", "compare", "compare-arms"):
        given[1:1] = ["--no-figures"]
    if given and given[0] in SHORT:
        given += SHORT[given[0]] if len(data) % 4 else ["--out=/dev/null/x"]
    place = folder() / "cli"
    place.mkdir(exist_ok=True)
    (place / "arm.urdf").write_bytes(urdf_seeds()[0])
    (place / "points.csv").write_bytes(POINTS[0])
    before, known = Path.cwd(), set(folder().iterdir())
    os.chdir(place)
    try:
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            app(given, standalone_mode=False)
    except ArmwrightError:
        raise
    except OSError as fault:  # reported by main()
        raise RunFolderError(f"cannot: {fault.strerror}") from fault
    except SystemExit as end:
        if end.code not in (None, 0, 1, 2, 130):
            raise DefectError(f"exit code {end.code}") from end
    except Exception as fault:
        if not type(fault).__module__.startswith(("click", "typer")):  # usage errors
            raise
    finally:
        os.chdir(before)
        if others := set(folder().iterdir()) - known:
            raise DefectError(f"files beside its folder: {others}")
        for entry in place.iterdir():
            shutil.rmtree(entry) if entry.is_dir() and not entry.is_symlink() else entry.unlink()


def _argument(value: Any) -> str:
    """Return an argument as a shell could pass it, without NUL."""
    text = value if isinstance(value, str) else json.dumps(value)
    return text.replace("\0", "").encode("utf-8", "replace").decode("utf-8")
