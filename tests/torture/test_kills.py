"""kill -9 at random moments: no trial is lost or doubled, and the result is unchanged."""

import csv
import json
import zlib
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.support import command_line
from tests.support.chat_server import GOOD_DESIGN, Answer, ChatServer, Request, wants_design
from tests.support.wire_formats import model_options
from tests.torture.lives import Scenario, kill_often
from tests.torture.short import files, is_beginning, is_same_run, n_lines, summary, trials

Maker = Callable[[Path, ChatServer], Scenario]


def study(n_total: int, *settings: str) -> Scenario:
    """A study of 5 random and so many counted trials."""
    method = ["--n-init", "5", "--n-step", "4", "--n-total", str(n_total), "--seed", "3", *settings]
    return Scenario(
        arguments=lambda folder: ["optimize", "target-1", *method, "--out", str(folder)],
        check=is_beginning,
        same=is_same_run,
    )


def done_here(arguments: Sequence[str]) -> None:
    done = command_line.armwright(*arguments)
    assert done.returncode == 0, done.stderr


def extension(_: Path, __: ChatServer) -> Scenario:
    """The command extends a finished run of 20 trials that it finds, or first makes it."""
    longer = study(50, "--proposer", "rules", "--no-figures")

    def begin(folder: Path) -> Sequence[str]:
        if not folder.exists():
            done_here(study(20, "--proposer", "rules", "--no-figures").arguments(folder))
        return longer.arguments(folder)

    return replace(longer, arguments=begin)


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


def model(_: Path, server: ChatServer) -> Scenario:
    server.answer = thoughtful

    def same(folder: Path, whole: Path) -> None:
        paid_once(folder)
        assert trials(folder) == trials(whole)
        # The model is tried once a session; an answer on its way when the kill came is asked for again.
        assert n_lines(folder / "transcripts.jsonl") >= n_lines(whole / "transcripts.jsonl")
        one, other = summary(folder), summary(whole)
        assert {**one, "proposer": None} == {**other, "proposer": None}

    return replace(study(40, "--model", "m", *model_options(base_url=server.url), "--no-figures"), same=same)


def model_in_flight(_: Path, server: ChatServer) -> Scenario:
    """What it comes to depends on when answers come, so its oracle is its own record, played again."""
    server.answer = thoughtful

    def numbered(folder: Path, whole: Path) -> None:
        assert [trial["number"] for trial in trials(folder)] == list(range(len(trials(folder))))

    def same(folder: Path, whole: Path) -> None:
        paid_once(folder)
        assert [trial["number"] for trial in trials(folder)] == list(range(45))
        assert sum(trial["source"] == "llm" for trial in trials(folder)) == 10
        n_requests = len(server.requests)
        again = folder.with_name(f"{folder.name}-again")
        replay = ("--proposer", f"replay:{folder}", "--no-figures")
        done_here(study(40, *replay).arguments(again))
        assert trials(again) == trials(folder)
        assert len(server.requests) == n_requests

    asked = study(40, "--model", "m", *model_options(base_url=server.url, in_flight=3), "--no-figures")
    return replace(asked, check=numbered, same=same)


def search(_: Path, __: ChatServer) -> Scenario:
    """Its state is written every 5 s; here more often, so that short searches go on, too."""
    often = "import armwright.study.front.direct_search as f; f.SAVE_SECONDS = 0.1"

    def is_front(folder: Path, whole: Path) -> None:
        assert trials(folder) in ([], trials(whole))

    def same(folder: Path, whole: Path) -> None:
        for name in ("trials.jsonl", "front.csv", "trials.csv"):
            assert (folder / name).read_bytes() == (whole / name).read_bytes()
        assert files(folder) == files(whole)
        assert summary(folder) == summary(whole)

    settings = ["--evaluations", "30000", "--no-stall", "--seed", "3", "--no-figures"]
    return Scenario(
        lambda folder: ["design", "target-1", *settings, "--out", str(folder)], is_front, same,
        program=("-c", f"{often}; from armwright.cli.app import main; main()"),
    )  # fmt: skip


EXPERIMENT: dict[str, Any] = {
    "name": "small", "tasks": ["target-1"], "seeds": 2, "n_init": 4, "n_total": 15,
    "methods": {
        "bbo": {"label": "BBO", "proposer": "none"},
        "rules": {"label": "BBO/rules", "proposer": "rules", "n_step": 3},
    },
}  # fmt: skip


def experiment(place: Path, _: ChatServer) -> Scenario:
    """Killed: its process, one of its workers, or all of them at once."""
    file = place / "small.yaml"
    file.write_text(yaml.safe_dump(EXPERIMENT), encoding="utf-8")
    cells = [Path("runs") / method / "target-1" / f"seed{seed}" for method in ("bbo", "rules") for seed in (0, 1)]

    def table(folder: Path) -> list[dict[str, str]]:
        rows = csv.DictReader((folder / "table.csv").read_text(encoding="utf-8").splitlines())
        return [{name: value for name, value in row.items() if "seconds" not in name} for row in rows]

    def check(folder: Path, whole: Path) -> None:
        for cell in cells:
            is_beginning(folder / cell, whole / cell)

    def same(folder: Path, whole: Path) -> None:
        for cell in cells:
            is_same_run(folder / cell, whole / cell)
        assert files(folder) == files(whole)
        assert table(folder) == table(whole)

    return Scenario(
        lambda folder: ["experiment", str(file), "--workers", "2", "--no-figures", "--out", str(folder)],
        check, same, victims=("process", "worker", "all"),
    )  # fmt: skip


def first_start(_: Path, __: ChatServer) -> Scenario:
    """The first command compiles the kernels; each folder here has a cache of its own, which is empty."""
    short = study(3, "--proposer", "none", "--no-figures")
    own = "import os, sys; os.environ['WARP_CACHE_PATH'] = sys.argv[-1] + '-cache'"
    return replace(short, program=("-c", f"{own}; from armwright.cli.app import main; main()"))


def plain(*settings: str, **changes: Any) -> Maker:
    return lambda _, __: replace(study(60, *settings), **changes)


def interrupted(make: Maker) -> Maker:
    return lambda place, server: replace(make(place, server), victims=("INT", "INT INT", "TERM"))


RULES = plain("--proposer", "rules", "--no-figures")
# Their share of all kills. Those that would get none in the short form are left to `make torture`, and so are THOROUGH
# ones, which go the way of others; tests/cli/test_signals.py interrupts commands, too.
THOROUGH = ("optimize, NSGA-II", "optimize, a model", "experiment", "optimize, Ctrl-C, Ctrl-C twice, SIGTERM")
SCENARIOS: dict[str, tuple[float, Maker]] = {
    "optimize, rules": (0.2, plain("--proposer", "rules")),
    "optimize, NSGA-II": (0.15, plain("--proposer", "none", "--sampler", "nsga2", "--no-figures")),
    "optimize, a larger --n-total": (0.05, extension),
    "optimize, a local worker": (
        0.05, plain("--proposer", "rules", "--workers", "1", "--no-figures", victims=("process", "worker", "all"))
    ),
    "optimize, a model": (0.125, model),
    "optimize, a model while it goes on": (0.125, model_in_flight),
    "front": (0.15, search),
    "experiment": (0.125, experiment),
    "the first start, kernels compiled": (0.025, first_start),
    "optimize, Ctrl-C, Ctrl-C twice, SIGTERM": (0.1, interrupted(RULES)),  # beside the kills
    "front, Ctrl-C, Ctrl-C twice, SIGTERM": (0.05, interrupted(search)),
}  # fmt: skip


@pytest.mark.parametrize("name", SCENARIOS)
def test_killed_command_resumes_to_the_same_result(
    name: str, tmp_path: Path, chat_server: ChatServer, kills: int, record_property: Callable[[str, object], None]
) -> None:
    share, make = SCENARIOS[name]
    own = round(share * kills)
    if own == 0 or (kills < 100 and name in THOROUGH):
        pytest.skip("killed in `make torture` alone")
    fell = kill_often(make(tmp_path, chat_server), tmp_path, own, name)
    who = ", ".join(f"{fell[victim]} of {victim}" for victim in fell if victim != "ended")
    record_property(name, f"{own} kills ({who}), {fell['ended']} runs to their end")
