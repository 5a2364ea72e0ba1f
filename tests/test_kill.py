"""kill -9 at any moment loses at most the trial in flight."""

import json
import random
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from tests.chat_server import GOOD_DESIGN, Answer, ChatServer, Request

KILLS = 20


def command(folder: Path, *proposer: str) -> list[str]:
    settings = ["--n-total", "200", "--n-step", "5", "--seed", "3", *proposer]
    return [sys.executable, "-m", "armwright", "optimize", "target-1", *settings, "--out", str(folder), "--json"]


def trials(folder: Path) -> list[dict[str, object]]:
    lines = (folder / "trials.jsonl").read_text().splitlines()
    return [{k: v for k, v in json.loads(line).items() if k != "seconds"} for line in lines]


def size(file: Path) -> int:
    return file.stat().st_size if file.exists() else 0


def kill_often(command: list[str], file: Path, length: int, seed: str) -> int:
    """Kills the command at random lengths of the file, so that kills fall into the work and not into the imports.

    Returns how many fell into the middle.
    """
    rng = random.Random(seed)
    in_the_middle = 0
    for left in range(KILLS, 0, -1):
        goal = size(file) + rng.randint(0, 2 * (length - size(file)) // (left + 1))
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        while size(file) < goal and process.poll() is None:
            try:
                process.wait(timeout=0.002)
            except subprocess.TimeoutExpired:
                continue
        in_the_middle += process.poll() is None and 0 < size(file) < length
        process.kill()
        process.wait()
    return in_the_middle


@pytest.mark.slow
@pytest.mark.parametrize("proposer", ["none", "rules"])
def test_a_run_killed_20_times_ends_as_an_uninterrupted_one(tmp_path: Path, proposer: str) -> None:
    whole, killed = (command(tmp_path / name, "--proposer", proposer) for name in ("whole", "killed"))
    subprocess.run(whole, check=True, capture_output=True)
    expected = trials(tmp_path / "whole")
    assert [trial["number"] for trial in expected] == list(range(210))
    file = tmp_path / "killed" / "trials.jsonl"
    assert kill_often(killed, file, size(tmp_path / "whole" / "trials.jsonl"), proposer) >= KILLS // 2
    subprocess.run(killed, check=True, capture_output=True)
    assert trials(tmp_path / "killed") == expected
    summaries = [json.loads((tmp_path / name / "summary.json").read_text()) for name in ("whole", "killed")]
    assert summaries[0]["hypervolume"] == summaries[1]["hypervolume"]


@pytest.mark.slow
def test_a_run_with_a_model_killed_20_times_pays_for_no_answer_twice(tmp_path: Path, chat_server: ChatServer) -> None:
    """With overlap, where answers come at any moment; afterwards its replay is equal to the bit."""

    def answer(request: Request) -> Answer:
        n = len(chat_server.requests)
        return json.dumps({**GOOD_DESIGN, "link_1": 0.1 + 1e-4 * n}) if "response_format" in request else f"idea {n}"

    chat_server.answer = answer
    model = ("--model", "m", "--base-url", chat_server.url, "--overlap", "--in-flight", "3")
    killed = command(tmp_path / "killed", *model)
    file = tmp_path / "killed" / "trials.jsonl"
    assert kill_often(killed, file, 210 * 330, "model") >= KILLS // 2
    subprocess.run(killed, check=True, capture_output=True)
    ended = trials(tmp_path / "killed")
    assert [trial["number"] for trial in ended] == list(range(210))
    assert sum(trial["source"] == "llm" for trial in ended) == 40
    used = Counter(trial["proposal"] for trial in ended if trial["proposal"])
    calls = [json.loads(line) for line in (tmp_path / "killed" / "transcripts.jsonl").read_text().splitlines()]
    paid = Counter((call["proposal"], call["step"]) for call in calls if call["proposal"])
    assert set(used.values()) == set(paid.values()) == {1}
    assert {proposal for proposal, step in paid if step == "parameters"} == used.keys()
    chat_server.requests.clear()
    replay = command(tmp_path / "again", "--proposer", f"replay:{tmp_path / 'killed'}", "--replay-strict")
    subprocess.run(replay, check=True, capture_output=True)
    assert trials(tmp_path / "again") == ended
    assert not chat_server.requests
