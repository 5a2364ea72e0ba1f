"""The command line as a user meets it."""

import inspect
import io
import json
import re
import subprocess
import sys
import threading
from pathlib import Path

import pytest
import typer
import yaml
from rich.console import Console
from rich.text import Text

from armwright.cli import search_commands
from armwright.cli.app import app
from armwright.cli.progress import study_progress
from armwright.llm import client as chat
from armwright.problem.problem import Problem
from armwright.proposers.replay import ReplayProposer
from armwright.study.study import optimize
from armwright.tasks.catalogue import load_task
from tests.support.chat_server import Answer, ChatServer, Request, designer
from tests.support.command_line import PATIENCE, armwright, press_ctrl_c, refused
from tests.support.wire_formats import model_options


@pytest.fixture(autouse=True)
def _no_pauses(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chat, "RETRY_SECONDS", 0.0)


SHORT = ("--no-figures", "--n-init", "4", "--n-step", "3", "--n-total", "6")


def test_optimize_runs_resumes_and_refuses_other_settings(in_folder: Path) -> None:
    done = armwright("optimize", "target-1", *SHORT)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert done.stdout.splitlines()[0] == "proposer: rules (no language model is configured; --model names one)"
    assert "iteration 6/6" in done.stdout
    assert "a toy" in done.stdout  # wherever N m are shown for the paper's masses
    run = in_folder / "runs" / "target-1-seed0"
    assert f"results: runs/{run.name}/" in done.stdout
    assert list((run / "designs").glob("*/arm.urdf"))

    again = armwright("optimize", "target-1", *SHORT)
    assert "is finished" in again.stdout
    fronts = [shown.stdout.partition("Pareto front")[2].splitlines()[:4] for shown in (done, again)]
    assert fronts[0] == fronts[1] != []
    longer = armwright("optimize", "target-1", *SHORT[:-1], "9")
    assert "resumed at trial 10 of 13" in longer.stdout
    message = refused(2, "optimize", "target-1", *SHORT[:-1], "9", "--seed", "0", "--proposer", "none")
    assert "proposer.name: rules stored, None requested" in message


def test_json_output_is_alone_on_stdout(in_folder: Path) -> None:
    done = armwright("optimize", "target-2", *SHORT, "--proposer", "none", "--json", "--out", "here")
    summary = json.loads(done.stdout)
    assert (summary["task"], summary["n_trials"], summary["folder"]) == ("target-2", 10, "here")
    assert "proposer: none" in done.stderr


def test_optimize_accepts_task_and_space_files(in_folder: Path) -> None:
    (in_folder / "points.csv").write_text("id;z;y;x\n7;100;0;450\n8;300;200;450\n", encoding="utf-8")
    made = armwright("init", "shelf.yaml", "--from", "points.csv", "--unit", "mm", "--offset", "0", "0", "0.5")
    assert made.returncode == 0, made.stderr
    assert made.stdout.startswith("note: points.csv: columns not used: 'id'\n")
    written = yaml.safe_load((in_folder / "shelf.yaml").read_text(encoding="utf-8"))
    assert written["targets"] == [[0.45, 0.0, 0.6], [0.45, 0.2, 0.8]]
    (in_folder / "space.yaml").write_text("joints: 3\nmass: {kind: per_link, kg: 0.002}\n", encoding="utf-8")
    done = armwright("optimize", "shelf.yaml", "--space", "space.yaml", "--sampler", "random", *SHORT)
    assert done.returncode == 0, done.stderr
    config = yaml.safe_load((in_folder / "runs/shelf-seed0/config.yaml").read_text(encoding="utf-8"))
    assert config["space"]["joints"] == 3
    assert config["reference_point"] is not None


def test_model_is_configured_by_option_environment_and_file(chat_server: ChatServer, in_folder: Path) -> None:
    def first_line(*args: str, **environment: str) -> str:
        done = armwright("optimize", "target-1", *SHORT, *args, **environment)
        assert done.returncode == 0, done.stderr
        return done.stdout.splitlines()[0]

    by_option = first_line("--model", "m", *model_options(base_url=chat_server.url), "--out", "a", "--prompt", "minus")
    assert by_option == f"proposer: llm (m at {chat_server.url}, named by --model; prompt minus)"
    by_environment = first_line("--out", "b", ARMWRIGHT_MODEL="m", ARMWRIGHT_BASE_URL=chat_server.url)
    assert "named by ARMWRIGHT_MODEL" in by_environment
    config = in_folder / "config" / "armwright" / "config.yaml"
    config.parent.mkdir(parents=True)
    config.write_text(f"model: m\nbase_url: {chat_server.url}\n", encoding="utf-8")
    by_file = first_line("--out", "c", XDG_CONFIG_HOME=str(in_folder / "config"))
    assert f"named by {config}" in by_file
    options = in_folder / "options.yaml"
    options.write_text(f"base_url: {chat_server.url}\nmodel: other\ntemperature: 0.5\n", encoding="utf-8")
    assert "named by --model" in first_line("--out", "e", "--model", "m", "--model-options", str(options))
    assert (chat_server.requests[-1]["model"], chat_server.requests[-1]["temperature"]) == ("m", 0.5)
    where = model_options(base_url=chat_server.url)
    config.write_text("temprature: 0\n", encoding="utf-8")
    wrong = refused(2, "optimize", "target-1", "--model", "m", *where, XDG_CONFIG_HOME=str(in_folder / "config"))
    assert f'{config}: unknown key "temprature"' in wrong
    assert "proposer: rules" in first_line("--out", "d", OPENAI_API_KEY="sk-lying-about")  # a key alone spends nothing
    assert len((in_folder / "a" / "transcripts.jsonl").read_text(encoding="utf-8").splitlines()) == 5


def test_init_writes_a_template_and_overwrites_nothing(in_folder: Path) -> None:
    assert "3 targets" in armwright("init", "my-task.yaml").stdout
    text = (in_folder / "my-task.yaml").read_text(encoding="utf-8")
    assert "# " in text
    assert "already exists" in refused(2, "init", "my-task.yaml")
    assert (in_folder / "my-task.yaml").read_text(encoding="utf-8") == text
    assert "ends in .yaml" in refused(2, "init", "my-task.txt")
    assert "cannot read" in refused(2, "init", "other.yaml", "--from", "nothing.csv")


def test_tasks_are_listed_and_described() -> None:
    listed = armwright("tasks").stdout
    for word in ("target-1", "slideopt-wide", "shelf", "armwright tasks NAME"):
        assert word in listed
    told = armwright("tasks", "target-1", "slideopt-wide", "random-7").stdout
    for word in ("(-0.45, -0.45, -0.45)", "reconstruction", "arXiv 2409.20038", "random_task(7)"):
        assert word in told
    assert json.loads(armwright("tasks", "--json").stdout)[0]["name"] == "target-1"
    assert 'Did you mean "shelf"' in refused(2, "tasks", "shelv")


def test_version_and_help() -> None:
    assert armwright("--version").stdout.strip() == "0.1.0"
    shown = armwright("--help", COLUMNS="120").stdout
    commands = re.findall(r"^│ ([a-z]+(?:-[a-z]+)*) ", shown, re.MULTILINE)
    assert commands == [
        *("init", "edit", "check", "tasks", "actuators", "draft"),
        *("design", "optimize", "experiment"),
        *("pick", "export", "simulate", "datasheet", "reach-map", "compare", "compare-arms"),
        *("report", "doctor"),
    ]
    assert len(inspect.signature(search_commands.optimize).parameters) <= 28


def test_every_parameter_has_a_help_whose_brackets_are_no_markup() -> None:
    """Units in brackets vanish from --help unless they are escaped."""
    commands = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    shown = [p for command in commands.values() for p in command.params if not getattr(p, "hidden", False)]
    texts = [one.help for one in (*commands.values(), *shown)]
    assert sum("[" in text for text in texts) > 5
    for text in texts:
        assert Text.from_markup(text).plain == text.replace("\\[", "[")


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (("targt-1",), 'unknown task "targt-1". Did you mean "target-1"?'),
        (("nothing.yaml",), "there is no file nothing.yaml"),
        (("target-1", "--space", "turns.yaml"), "exceeds ±2π"),
        (("bad.yaml",), 'unknown key "target".'),
        (("target-1", "--space", "nothing.yaml"), "cannot read nothing.yaml"),
        (("target-1", "--n-step", "0"), "n_step: expected a whole number from 1 to"),
        (("target-1", "--sampler", "tpee"), 'Did you mean "tpe"?'),
        (("target-1", "--proposer", "llm"), "needs a language model"),
        (("target-1", "--model", "openai-chat:gpt-4o"), "OPENAI_API_KEY"),
        (("target-1", "--memory", "chta"), 'memory: expected none or chat, got "chta"; try "chat"'),
        (("target-1", "--max-cost", "1"), "max_cost = 1.0 needs a language model, and none is configured"),
        (
            ("target-1", "--proposer", "replay:x", *model_options(temperature=0)),
            "replay:x does not use temperature = 0.0",
        ),
        (("target-1", *model_options(temprature=0)), 'Did you mean "temperature"?'),
        (("target-1", "--max-cost", "-1"), "command line: max_cost: expected a number above 0, got -1.0"),
        (("target-1", "--proposer", "manual"), "needs a folder: manual:PATH"),
        (("target-1", "--model", "m", *model_options(base_url="http://x/v1?key=secret")), "ARMWRIGHT_API_KEY"),
    ],
)
def test_usage_errors_are_one_line_and_exit_with_2(in_folder: Path, args: tuple[str, ...], words: str) -> None:
    (in_folder / "bad.yaml").write_text("name: a\ntarget: [[0, 0, 0]]", encoding="utf-8")
    (in_folder / "turns.yaml").write_text("joint_range: [-10, 10]", encoding="utf-8")
    assert words in refused(2, "optimize", *args)
    assert not (in_folder / "runs").exists()


def test_unreachable_server_exits_with_1(in_folder: Path) -> None:
    message = refused(1, "optimize", "target-1", "--model", "m", *model_options(base_url="http://127.0.0.1:9/v1"))
    assert "--proposer rules needs none" in message


def test_doctor_shows_the_configuration_without_keys(chat_server: ChatServer, in_folder: Path) -> None:
    done = armwright("doctor", OPENAI_API_KEY="sk-planted-in-the-environment")
    assert done.returncode == 0, done.stderr
    assert "ok openai-chat: OPENAI_API_KEY set" in done.stdout
    assert "-- anthropic: ANTHROPIC_API_KEY not set" in done.stdout
    assert "-- google: GOOGLE_API_KEY or GEMINI_API_KEY not set" in done.stdout
    assert "ok google: GEMINI_API_KEY set" in armwright("doctor", GEMINI_API_KEY="planted").stdout
    assert "-- model: none is configured" in done.stdout
    assert "planted" not in done.stdout + done.stderr
    where = ("--model", "m", *model_options(base_url=chat_server.url))
    assert not armwright("doctor", *where).stderr
    assert not chat_server.requests
    wrong = armwright("doctor", "--model", "openai-chat:gpt-4o")
    assert wrong.returncode == 1
    assert "model openai-chat:gpt-4o needs OPENAI_API_KEY" in wrong.stdout


@pytest.mark.parametrize("place", ["file/run", "/proc/armwright"])
def test_unwritable_output_folder_exits_with_1(in_folder: Path, place: str) -> None:
    """This also holds for root, who may write to read-only folders."""
    (in_folder / "file").write_text("", encoding="utf-8")
    assert f"cannot write {place}" in refused(1, "optimize", "target-1", *SHORT, "--out", place)


@pytest.mark.slow
def test_unwritable_output_is_one_line(in_folder: Path) -> None:
    with open("/dev/full", "w", encoding="utf-8") as full:
        command = [sys.executable, "-m", "armwright", "optimize", "target-1", *SHORT]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, encoding="utf-8")
    assert (done.returncode, done.stderr) == (1, "armwright: No space left on device: the output\n")


def test_file_and_folder_names_are_printed_literally(in_folder: Path) -> None:
    """No markup or emoji is interpreted, for a task file of any name."""
    made = armwright("init", "мой [b] файл.yaml")
    assert made.returncode == 0, made.stderr
    done = armwright("optimize", "мой [b] файл.yaml", *SHORT, "--out", "o/[red]a:smile:[/b]")
    assert done.returncode == 0, done.stderr
    assert "results: o/[red]a:smile:[/b]/" in done.stdout
    assert (in_folder / "o/[red]a:smile:[/b]/summary.json").exists()


@pytest.mark.parametrize(("in_flight", "refused"), [(None, 0), (1, 1)], ids=["waiting", "overlap"])
def test_ctrl_c_cancels_model_calls_in_flight(
    chat_server: ChatServer, in_folder: Path, in_flight: int | None, refused: int
) -> None:
    """While the server withholds its answers, the command ends, records paid answers, and says how to resume."""
    released = threading.Event()

    def answer(request: Request) -> Answer:
        n = len(chat_server.requests)  # a check, the thoughts, and perhaps a design that is refused
        if n == 3 and refused:
            return "no design"
        if n > 2:
            press_ctrl_c()
            released.wait(PATIENCE)
        return designer(request)

    chat_server.answer = answer
    done = armwright(
        "optimize", "target-1", "--model", "m", *model_options(base_url=chat_server.url, in_flight=in_flight)
    )
    released.set()
    assert (done.returncode, done.stderr) == (130, "")
    assert "Resume with:" in done.stdout
    transcript = (in_folder / "runs" / "target-1-seed0" / "transcripts.jsonl").read_text(encoding="utf-8").splitlines()
    kept = [(call["step"], call["requests"], call["fault"]) for call in map(json.loads, transcript)]
    assert kept == [("check", 1, None), ("reasoning", 1, None), ("parameters", 1, "cancelled")][: 2 + refused]


DROPPED = """
import os, signal, threading
import armwright.cli.app as cli

class Finalised:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGTERM)
        threading.Event().wait(600)  # here the signal is heeded, and what it raises is dropped

def app():
    Finalised()
    threading.Event().wait(600)
    print("not heeded")

cli.app = app
cli.main()
"""


@pytest.mark.slow
def test_interrupt_dropped_by_python_still_ends_the_command() -> None:
    """This happens in finalisers and library callbacks, where exceptions cannot propagate."""
    done = subprocess.run([sys.executable, "-c", DROPPED], capture_output=True, text=True, encoding="utf-8")
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")


def test_progress_is_shown_in_a_terminal() -> None:
    console = Console(file=io.StringIO(), force_terminal=True, width=60, markup=False, highlight=False)
    with study_progress(console) as watch:
        optimize(Problem(load_task("target-1")), proposer="rules", n_init=3, n_step=5, n_total=7, watch=watch)
    shown = console.file.getvalue()  # type: ignore[attr-defined]
    assert "iteration 7/7" in shown
    assert "hypervolume" in shown
    assert "verifying" in shown
    assert "None" not in shown


def test_reasons_of_a_model_are_shown_as_they_enter() -> None:
    console = Console(file=io.StringIO(), width=500, markup=False, highlight=False)
    proposer = ReplayProposer("target-1-plus-seed0")
    with study_progress(console) as watch:
        run = optimize(Problem(load_task("target-1")), proposer=proposer, n_init=10, n_step=10, n_total=11, watch=watch)
    reasons = [f"trial {t.number}, language model: {t.reason}" for t in run.trials if t.source == "llm"]
    assert len(reasons) == 2
    lines = console.file.getvalue().splitlines()  # type: ignore[attr-defined]
    assert [line for line in lines if "language model: " in line] == reasons


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "heavy"),
    [
        ("--help", {"warp", "optuna", "matplotlib", "moocore", "numpy", "pydantic", "pydantic_ai"}),
        ("tasks target-1", {"warp", "optuna", "pydantic_ai", "armwright.llm", "armwright.proposers"}),
    ],
)
def test_command_imports_no_heavy_package(command: str, heavy: set[str]) -> None:
    run = f"import sys, atexit; sys.argv[1:] = {command.split()}; from armwright.cli.app import main"
    code = f"{run}; atexit.register(lambda: print(*({heavy!r} & set(sys.modules)), file=sys.stderr)); main()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, encoding="utf-8")
    assert (done.returncode, done.stderr.split()) == (0, [])
