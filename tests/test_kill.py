"""kill -9 at any moment loses at most the trial in flight."""

import json
import random
import subprocess
import sys
from pathlib import Path

import pytest

KILLS = 20


def command(folder: Path, proposer: str) -> list[str]:
    settings = ["--proposer", proposer, "--n-total", "200", "--n-step", "5", "--seed", "3"]
    return [sys.executable, "-m", "armwright", "optimize", "target-1", *settings, "--out", str(folder), "--json"]


def trials(folder: Path) -> list[dict[str, object]]:
    lines = (folder / "trials.jsonl").read_text().splitlines()
    return [{k: v for k, v in json.loads(line).items() if k != "seconds"} for line in lines]


def size(file: Path) -> int:
    return file.stat().st_size if file.exists() else 0


@pytest.mark.slow
@pytest.mark.parametrize("proposer", ["none", "rules"])
def test_a_run_killed_20_times_ends_as_an_uninterrupted_one(tmp_path: Path, proposer: str) -> None:
    subprocess.run(command(tmp_path / "whole", proposer), check=True, capture_output=True)
    expected = trials(tmp_path / "whole")
    assert [trial["number"] for trial in expected] == list(range(210))
    length = size(tmp_path / "whole" / "trials.jsonl")
    rng = random.Random(proposer)
    file = tmp_path / "killed" / "trials.jsonl"
    in_the_middle = 0
    for left in range(KILLS, 0, -1):
        # at a random length of the file, so that kills fall into the work and not into the imports
        goal = size(file) + rng.randint(0, 2 * (length - size(file)) // (left + 1))
        process = subprocess.Popen(command(tmp_path / "killed", proposer), stdout=subprocess.DEVNULL)
        while size(file) < goal and process.poll() is None:
            try:
                process.wait(timeout=0.002)
            except subprocess.TimeoutExpired:
                continue
        in_the_middle += process.poll() is None and 0 < size(file) < length
        process.kill()
        process.wait()
    assert in_the_middle >= KILLS // 2
    subprocess.run(command(tmp_path / "killed", proposer), check=True, capture_output=True)
    assert trials(tmp_path / "killed") == expected
    summaries = [json.loads((tmp_path / name / "summary.json").read_text()) for name in ("whole", "killed")]
    assert summaries[0]["hypervolume"] == summaries[1]["hypervolume"]
