"""`front`, `polish` and `verify` on the command line."""

import json
from pathlib import Path

import pytest

from tests.cli.test_cli import SHORT
from tests.support.command_line import armwright, refused


def test_front_polish_and_verify(in_folder: Path) -> None:
    done = armwright("front", "target-1", "--budget", "3000", "--seed", "4", "--no-figures")
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    for words in ("of the best known hypervolume", "robust", "sensitive", "budget spent", "a toy"):
        assert words in done.stdout
    assert (in_folder / "runs" / "target-1-front-seed4" / "summary.json").is_file()
    more = armwright("front", "target-1", "--budget", "4000", "--seed", "4", "--no-figures", "--json")
    summary = json.loads(more.stdout)
    assert summary["search"]["evaluations"] >= 4000
    assert summary["folder"] == "runs/target-1-front-seed4"

    armwright("optimize", "target-1", *SHORT, "--out", "mine")
    polished = armwright("polish", "mine", "--evaluations", "120")
    assert polished.returncode == 0, polished.stderr
    assert "improved designs" in polished.stdout
    assert " refine " in polished.stdout
    verified = armwright("verify", "mine", "--json")
    record = json.loads(verified.stdout)["verification"]
    assert record["robust"] + record["sensitive"] == json.loads(verified.stdout)["front_size"]
    assert "from other initial postures" in armwright("verify", "mine").stdout
    again = armwright("optimize", "target-1", *SHORT, "--out", "mine")
    assert "is finished; nothing was computed again" in again.stdout

    begun = armwright("front", "target-1", "--budget", "500", "--from", "mine", "--no-figures", "--out", "begun")
    assert begun.returncode == 0, begun.stderr


@pytest.mark.slow
def test_front_and_polish_draw_their_figures(in_folder: Path) -> None:
    armwright("front", "target-1", "--budget", "1000", "--out", "front")
    armwright("optimize", "target-1", *SHORT, "--out", "mine")
    armwright("polish", "mine", "--evaluations", "60")
    for folder in ("front", "mine"):
        drawn = {path.name for path in (in_folder / folder / "figures").iterdir()}
        assert {"hypervolume.png", "front.png", "arms.pdf"} <= drawn


def test_robust_and_refine_every(in_folder: Path) -> None:
    done = armwright(
        "optimize", "target-1", *SHORT, "--robust", "--refine-every", "3", "--proposer", "none", "--out", "r", "--json"
    )
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["evaluations"] > summary["n_trials"]
    assert summary["best_known"] is None
    config = (in_folder / "r" / "config.yaml").read_text()
    assert "tolerance: 0.001" in config
    assert "refine_every: 3" in config
    line = refused(2, "optimize", "target-1", *SHORT, "--proposer", "none", "--refine-every", "3", "--out", "r")
    assert "tolerance: 0.001 there, 0.0 asked" in line


@pytest.mark.parametrize(
    ("code", "args", "words"),
    [
        (2, ("front", "target-1", "--budget", "0"), 'budget = "0" is neither a time above 0'),
        (2, ("front", "target-1", "--budget", "5 bananas"), 'budget = "5 bananas"'),
        (2, ("front", "target-1", "--budget", "-1s"), 'budget = "-1s"'),
        (2, ("front", "target-9"), 'unknown task "target-9"'),
        (2, ("front", "target-1", "--device", "cuda"), "no NVIDIA GPU"),
        (2, ("front", "target-1", "--device", "tpu"), 'device = "tpu" is not one of'),
        (2, ("front", "target-1", "--proposer", "none"), "gives no designs"),
        (2, ("front", "target-1", "--proposer", "rules", "--from", "x"), "choose one"),
        (1, ("front", "target-1", "--from", "nothing"), "not a run folder"),
        (2, ("optimize", "target-1", "--refine-every", "0"), "refine_every = 0"),
        (1, ("polish", "nothing"), "not a run folder"),
        (1, ("verify", "nothing"), "not a run folder"),
    ],
)
def test_mistakes(in_folder: Path, code: int, args: tuple[str, ...], words: str) -> None:
    assert words in refused(code, *args)
    assert not list(in_folder.glob("runs/*"))


def test_a_search_is_not_polished_and_a_study_not_continued_as_a_search(in_folder: Path) -> None:
    armwright("front", "target-1", "--budget", "300", "--no-figures", "--out", "run")
    assert "not a study" in refused(1, "polish", "run")
    assert "holds a run with other settings" in refused(2, "optimize", "target-1", "--out", "run")
    assert "not a study" in refused(1, "prompt", "--after", "run")
    assert "to replay" in refused(1, "optimize", "target-1", "--proposer", "replay:run", "--out", "other")
