"""kill -9 at random moments: no trial is lost or doubled, and the result is unchanged."""

import csv
import json
import subprocess
import sys
import zlib
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from armwright.runs.folder import is_held
from tests.support.chat_server import GOOD_DESIGN, Answer, ChatServer, Request, wants_design
from tests.support.wire_formats import model_options
from tests.torture.lives import (
    Scenario,
    files,
    is_beginning,
    is_same_run,
    kill_often,
    n_lines,
    summary,
    trials,
)

pytestmark = pytest.mark.slow
Tell = Callable[[str, object], None]

# Of all kills; the kernels' cache takes long to fill, so it is killed less often.
SHARES = {
    "optimize, rules": 0.2,
    "optimize, NSGA-II": 0.15,
    "optimize, a larger --n-total": 0.05,
    "optimize, a local worker": 0.05,
    "optimize, a model": 0.125,
    "optimize, a model while it goes on": 0.125,
    "front": 0.15,
    "experiment": 0.125,
    "the first start, kernels compiled": 0.025,
    "optimize, Ctrl-C, Ctrl-C twice, SIGTERM": 0.1,  # beside the kills
    "front, Ctrl-C, Ctrl-C twice, SIGTERM": 0.05,
}


@pytest.fixture
def torture(
    request: pytest.FixtureRequest, tmp_path: Path, record_property: Tell
) -> Callable[[str, Scenario], Counter[str]]:
    """Kills a scenario as often as is its share, and tells of it."""

    def kill(name: str, scenario: Scenario) -> Counter[str]:
        kills = max(1, round(SHARES[name] * request.config.getoption("--kills")))
        fell = kill_often(scenario, tmp_path, kills, name)
        parts = ", ".join(f"{fell[part]} in its {part}" for part in ("start", "search", "results") if fell[part])
        worker = f", {fell['worker']} of a worker" if fell["worker"] else ""
        record_property(
            name, f"{fell.total() - fell['ended']} kills ({parts}{worker}), {fell['ended']} runs to their end"
        )
        return fell

    return kill


def study(n_total: int, *settings: str) -> Scenario:
    """A study of 5 random and so many counted trials."""
    method = ["--n-init", "5", "--n-step", "4", "--n-total", str(n_total), "--seed", "3", *settings]
    return Scenario(
        arguments=lambda folder: ["optimize", "target-1", *method, "--out", str(folder)],
        progress=lambda folder: n_lines(folder / "trials.jsonl") / (5 + n_total),
        check=is_beginning,
        same=is_same_run,
    )


def test_killed_study_with_figures(torture: Callable[[str, Scenario], Counter[str]]) -> None:
    torture("optimize, rules", study(60, "--proposer", "rules"))


def test_killed_study_with_sampler_notes(torture: Callable[[str, Scenario], Counter[str]]) -> None:
    settings = ("--proposer", "none", "--sampler", "nsga2", "--no-figures")
    torture("optimize, NSGA-II", study(60, *settings))


def test_killed_extension_of_a_finished_study(torture: Callable[[str, Scenario], Counter[str]], tmp_path: Path) -> None:
    """The command extends a finished run of 20 trials that it finds, or first makes it."""
    longer = study(50, "--proposer", "rules", "--no-figures")

    def begin(folder: Path) -> list[str]:
        if not folder.exists():
            arguments = study(20, "--proposer", "rules", "--no-figures").arguments(folder)
            subprocess.run([sys.executable, "-m", "armwright", *arguments], check=True, capture_output=True)
        return list(longer.arguments(folder))

    torture(
        "optimize, a larger --n-total",
        Scenario(
            begin, lambda folder: max(0.0, (n_lines(folder / "trials.jsonl") - 25) / 30), is_beginning, is_same_run
        ),
    )


def test_killed_study_with_a_local_worker(torture: Callable[[str, Scenario], Counter[str]]) -> None:
    """Killed: its process, its worker, or all at once."""
    scenario = study(40, "--proposer", "rules", "--workers", "1", "--no-figures")
    torture("optimize, a local worker", replace(scenario, victims=("process", "worker", "all")))


def thoughtful(request: Request) -> Answer:
    """An answer that depends on the question alone, as a model's at temperature 0."""
    sum_ = zlib.crc32(json.dumps(request["messages"]).encode())
    if wants_design(request):
        return json.dumps({**GOOD_DESIGN, "link_1": 0.1 + sum_ % 1000 * 1e-4})
    return f"idea {sum_}"


def paid_once(folder: Path) -> None:
    """Each step of each proposal was answered once, and each proposal used once."""
    used = Counter(trial["proposal"] for trial in trials(folder) if trial["proposal"])
    assert set(used.values()) <= {1}
    content = (folder / "transcripts.jsonl").read_bytes()
    calls = [json.loads(line) for line in content[: content.rfind(b"\n") + 1].splitlines()]
    paid = Counter((call["proposal"], call["step"]) for call in calls if call["proposal"] and call["fault"] is None)
    assert set(paid.values()) <= {1}
    assert used.keys() <= {proposal for proposal, step in paid if step == "parameters"}


def test_killed_study_with_a_model(
    torture: Callable[[str, Scenario], Counter[str]], chat_server: ChatServer, record_property: Tell
) -> None:
    chat_server.answer = thoughtful
    asked = study(40, "--model", "m", *model_options(base_url=chat_server.url), "--no-figures")

    def same(folder: Path, whole: Path) -> None:
        paid_once(folder)
        assert trials(folder) == trials(whole)
        n_calls = [
            len((place / "transcripts.jsonl").read_text(encoding="utf-8").splitlines()) for place in (folder, whole)
        ]
        # The model is tried once a session; an answer on its way when the kill came is asked for again.
        assert n_calls[0] >= n_calls[1]
        one, other = (
            {key: value for key, value in summary(place).items() if key != "proposer"} for place in (folder, whole)
        )
        assert one == other

    torture("optimize, a model", Scenario(asked.arguments, asked.progress, is_beginning, same))


def test_killed_study_with_model_calls_in_flight(
    torture: Callable[[str, Scenario], Counter[str]], chat_server: ChatServer, tmp_path: Path
) -> None:
    """What it comes to depends on when answers come, so its oracle is its own record, played again."""
    chat_server.answer = thoughtful
    settings = ("--model", "m", *model_options(base_url=chat_server.url, in_flight=3), "--no-figures")
    asked = study(40, *settings)

    def numbered(folder: Path, whole: Path) -> None:
        assert [trial["number"] for trial in trials(folder)] == list(range(len(trials(folder))))

    def same(folder: Path, whole: Path) -> None:
        paid_once(folder)
        assert [trial["number"] for trial in trials(folder)] == list(range(45))
        assert sum(trial["source"] == "llm" for trial in trials(folder)) == 10
        n_requests = len(chat_server.requests)
        again = folder.with_name(f"{folder.name}-again")
        replay = study(
            40, "--proposer", f"replay:{folder}", *model_options(replay_strict=True), "--no-figures"
        ).arguments(again)
        subprocess.run([sys.executable, "-m", "armwright", *replay], check=True, capture_output=True)
        assert trials(again) == trials(folder)
        assert len(chat_server.requests) == n_requests

    torture("optimize, a model while it goes on", Scenario(asked.arguments, asked.progress, numbered, same))


# Its state is written every 5 s; here more often, so that short searches go on, too.
OFTEN = (
    "import armwright.study.front.direct_search as f; f.SAVE_SECONDS = 0.1; from armwright.cli.app import main; main()"
)
BUDGET = 30_000


def evaluations(folder: Path) -> float:
    try:
        there = (folder / "search.npz").stat()
    except FileNotFoundError:
        return 0.0
    return _evaluations(folder / "search.npz", there.st_mtime_ns)


@cache
def _evaluations(state: Path, _mtime: int) -> float:
    with np.load(state) as content:
        return float(content["evaluations"]) / BUDGET


def is_front(folder: Path, whole: Path) -> None:
    """Its trials are the front of the whole search, or none yet."""
    assert trials(folder) in ([], trials(whole))


def is_same_front(folder: Path, whole: Path) -> None:
    assert (folder / "trials.jsonl").read_bytes() == (whole / "trials.jsonl").read_bytes()
    assert files(folder) == files(whole)
    for name in ("front.csv", "trials.csv"):
        assert (folder / name).read_bytes() == (whole / name).read_bytes()
    assert summary(folder) == summary(whole)


def searching(folder: Path) -> list[str]:
    settings = ["--evaluations", str(BUDGET), "--no-stall", "--seed", "3", "--no-figures"]
    return ["design", "target-1", *settings, "--out", str(folder)]


SEARCH = Scenario(
    searching, evaluations, is_front, is_same_front,
    program=("-c", OFTEN), is_begun=lambda command: is_held(command.folder),
)  # fmt: skip


def test_killed_front_search(torture: Callable[[str, Scenario], Counter[str]]) -> None:
    torture("front", SEARCH)


EXPERIMENT: dict[str, Any] = {
    "name": "small",
    "tasks": ["target-1"],
    "seeds": 2,
    "n_init": 4,
    "n_total": 30,
    "methods": {
        "bbo": {"label": "BBO", "proposer": "none"},
        "rules": {"label": "BBO/rules", "proposer": "rules", "n_step": 3},
    },
}


def table(folder: Path) -> list[dict[str, str]]:
    rows = csv.DictReader((folder / "table.csv").read_text(encoding="utf-8").splitlines())
    return [{name: value for name, value in row.items() if "seconds" not in name} for row in rows]


def test_killed_experiment(torture: Callable[[str, Scenario], Counter[str]], tmp_path: Path) -> None:
    """Killed: its process, one of its workers, or all of them at once."""
    file = tmp_path / "small.yaml"
    file.write_text(yaml.safe_dump(EXPERIMENT), encoding="utf-8")
    cells = [Path("runs") / method / "target-1" / f"seed{seed}" for method in ("bbo", "rules") for seed in (0, 1)]

    def progress(folder: Path) -> float:
        return sum(n_lines(folder / cell / "trials.jsonl") for cell in cells) / (34 * len(cells))

    def check(folder: Path, whole: Path) -> None:
        for cell in cells:
            is_beginning(folder / cell, whole / cell)

    def same(folder: Path, whole: Path) -> None:
        for cell in cells:
            is_same_run(folder / cell, whole / cell)
        assert files(folder) == files(whole)
        assert table(folder) == table(whole)

    victims = ("process", "worker", "all")
    torture(
        "experiment",
        Scenario(
            lambda folder: ["experiment", str(file), "--workers", "2", "--no-figures", "--out", str(folder)],
            progress, check, same, victims=victims,
        ),
    )  # fmt: skip


@pytest.mark.usefixtures("thorough")
def test_killed_first_start(torture: Callable[[str, Scenario], Counter[str]], monkeypatch: pytest.MonkeyPatch) -> None:
    """The kernels are compiled by the first command; each folder here has a cache of its own, which is empty."""
    short = study(3, "--proposer", "none", "--no-figures")

    def arguments(folder: Path) -> list[str]:
        monkeypatch.setenv("WARP_CACHE_PATH", str(folder.with_name(f"{folder.name}-cache")))
        return list(short.arguments(folder))

    torture("the first start, kernels compiled", Scenario(arguments, short.progress, is_beginning, is_same_run))


ENDED = ("INT", "INT INT", "TERM")


def test_interrupted_study(torture: Callable[[str, Scenario], Counter[str]]) -> None:
    scenario = study(60, "--proposer", "rules", "--no-figures")
    torture("optimize, Ctrl-C, Ctrl-C twice, SIGTERM", replace(scenario, victims=ENDED))


def test_interrupted_front_search(torture: Callable[[str, Scenario], Counter[str]]) -> None:
    torture("front, Ctrl-C, Ctrl-C twice, SIGTERM", replace(SEARCH, victims=ENDED))
