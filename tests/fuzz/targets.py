"""What is fuzzed: of each door the valid documents that it opens to, and what is done with one that passes.

A target is given bytes. It may raise what the door raises on purpose (ArmwrightError), and nothing else; what passes is
used as far as a command would use it.
"""

import asyncio
import io
import json
import os
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from pathlib import Path
from random import Random
from typing import Any

import yaml

import armwright as aw
from armwright.exceptions import ArmwrightError, RunFolderError
from armwright.problem.problem import Problem
from armwright.runs.history import History
from armwright.spaces.design_space import DesignSpace, load_space
from armwright.tasks.catalogue import load_task
from armwright.tasks.task import Task
from tests import ROOT
from tests.fuzz.mutation import changed
from tests.support.wire_formats import llm_proposer

LONGEST_REFUSAL = 3000  # characters
MOST_POSTURES = 300  # of an arm that is evaluated here: more takes longer, and is no other code


class DefectError(AssertionError):
    """What was refused was not refused as it should be."""


@dataclass(frozen=True)
class Target:
    """A door.

    form: of its documents: yaml, json, jsonl, or text. seeds: valid ones. run: what is done with one.
    heavy: whether an input that passes takes milliseconds, not a part of one.
    """

    form: str
    seeds: Callable[[], list[bytes]]
    run: Callable[[bytes], None]
    heavy: bool = False

    def make(self, rng: Random) -> bytes:
        """An input: a valid document, changed."""
        return changed(rng.choice(seeds_of(self)), self.form, rng)


def check(target: Target, data: bytes) -> bool:
    """Whether an input passed; DefectError, or what else it raised, is a defect."""
    try:
        target.run(data)
    except ArmwrightError as refusal:
        check_words(refusal)
        return False
    return True


def check_words(refusal: ArmwrightError) -> None:
    words = str(refusal)
    if len(words) > LONGEST_REFUSAL:
        raise DefectError(f"a refusal of {len(words)} characters: {words[:200]!r}") from refusal
    if not words or not words.isprintable():
        raise DefectError(f"a refusal that is no line: {words[:500]!r}") from refusal


@cache
def seeds_of(target: Target) -> list[bytes]:
    """Its valid documents."""
    return target.seeds()


@cache
def folder() -> Path:
    """Where inputs lie as files, in memory where there is such a place; of this process alone."""
    place = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
    made = Path(tempfile.mkdtemp(prefix="armwright-fuzz-", dir=place))
    import atexit

    atexit.register(shutil.rmtree, made, ignore_errors=True)
    return made


def file_of(data: bytes, name: str) -> Path:
    path = folder() / name
    path.write_bytes(data)
    return path


def shipped(place: str) -> list[bytes]:
    """Files that come with armwright."""
    found = (resources.files("armwright") / place).iterdir()
    return [file.read_bytes() for file in sorted(found, key=lambda file: file.name) if file.name.endswith(".yaml")]


def of_examples(part: str) -> list[bytes]:
    return [file.read_bytes() for file in sorted((ROOT / "examples").glob(f"*{part}*.yaml"))]


# Tasks and spaces

RICH_TASK = b"""\
name: rich
targets:
  - {position: [0.4, 0.0, 0.1], axis: [0, 0, -1], tolerance: 0.002, angle_tolerance: 0.05, weight: 2}
  - {position: [0.4, 0.2, 0.1], orientation: [3.1416, 0, 1.5708]}
  - [0.1, 0.35, 0.5]
payload: [0.5, 0.5, 0.0]
payload_factors: [0.0, 1.2]
target_noise: 0.005
restarts: 2
obstacles:
  - {kind: ground, name: table, z: -0.2}
  - {kind: box, name: shelf, center: [0.4, 0.0, 0.3], size: [0.2, 0.6, 0.02], yaw: 0.1}
  - {kind: box, center: [0.4, 0.0, 0.3], size: [0.2, 0.6, 0.02], rpy: [0.1, 0.2, 0.3]}
  - {kind: sphere, center: [0.0, 0.4, 0.3], radius: 0.1}
  - {kind: cylinder, center: [0.2, 0.3, 0.5], radius: 0.03, height: 1.0, axis: [1, 0, 1]}
moves: [[1, 2], [2, 3]]
move_step: 0.05
move_time: [1.5, 2]
workspace: {low: [0.2, -0.3, 0.0], high: [0.6, 0.3, 0.4], points: 20}
objectives: [worst_error, torque, collision, path_error, dynamic_torque]
constraints: [mass <= 3, length >= 0.2, uncovered_fraction <= 0.9]
reference_point: [1.0, 5.0, 2.0, 3.0, 4.0]
description: What the arm has to do there.
provenance: Measured.
"""
RICH_SPACE = b"""\
name: rich
joints: [2, 5]
joint_types: [R, P, Y, O, X, F]
joint_range: [-2.8, 2.8]
limit: [0.5, 2.5]
stroke: [0.1, 0.4]
travel: 0.02
origin_x: [-0.5, 0.5]
origin_z: [0.0, 0.0]
mount: [floor, ceiling, wall+x]
link: [0.05, 0.40]
link_directions: [+z, +x, -y]
link_radius: 0.02
tool: [0.0, 0.0, 0.1]
mass: {kind: tube, density: 2700, outer_diameter: 0.03, wall: 0.002}
actuators:
  - XM540-W270
  - XL430-W250
  - {name: mine, maker: me, kind: servo, voltage: 12, mass: 0.3, stall_torque: 6.0, speed: 5.0, price: 120, source: me}
actuator_torque: stall
safety_factor: 2.0
restrict: {joint_1: [R, P], origin_y: 0.0, link_3: [0.1, 0.2]}
grid: {link: 0.005, origin_x: 0.1}
tie: {link_2: link_1}
"""


def _postures(problem: Problem) -> int:
    task = problem.task
    moves = sum(task.straight_moves.steps(task.target_positions)) + len(task.straight_moves)
    parts = len(task.targets) * (1 + task.restarts) + moves + sum(region.points for region in task.workspace)
    return parts * len(task.cases)


def used(problem: Problem) -> None:
    """What every run does with a problem: designs are drawn, evaluated, exported, and told to a model."""
    from armwright.llm.prompt import load_prompt
    from armwright.robot.urdf_writer import to_urdf

    designs = problem.space.sample(2, 0)
    arms = [problem.arm(design) for design in designs]
    to_urdf(arms[0])
    for design in designs:
        if problem.space.design(design.params) != design:
            raise DefectError(f"a design that is not in its space: {design.params}")
    if _postures(problem) <= MOST_POSTURES:
        problem.evaluate(designs)
    load_prompt("plus").render(History(problem, [], 1, problem.reference_point), 0)


def same_when_kept(value: Task | DesignSpace) -> None:
    """What is written into a run's settings is read back as the same."""
    from armwright.yaml_documents import dump_document

    content = value.model_dump(mode="json")
    json.dumps(content, allow_nan=False)
    text = dump_document(content)
    path = folder() / "kept.yaml"
    path.write_text(text, encoding="utf-8")
    again = load_task(path) if isinstance(value, Task) else load_space(path)
    if again != value:
        raise DefectError(f"{value!r} is read back as {again!r}")


def run_task(data: bytes) -> None:
    task = load_task(file_of(data, "task.yaml"))
    same_when_kept(task)
    used(Problem(task, rich_problem().space))


def run_space(data: bytes) -> None:
    space = load_space(file_of(data, "space.yaml"))
    same_when_kept(space)
    used(Problem(load_task("target-1"), space))


def run_experiment(data: bytes) -> None:
    from armwright.experiments.cells import MAX_CELLS, plan_cells
    from armwright.experiments.plan import load_experiment

    out = folder() / "out"
    plan, beside = load_experiment(str(file_of(data, "experiment.yaml")))
    if 2000 < len(plan.task_list) * len(plan.seed_list) * len(plan.methods) <= MAX_CELLS:
        return
    cells, skipped = plan_cells(plan, beside, out)
    for cell in [*cells, *(one.cell for one in skipped)]:
        if not cell.folder.is_relative_to(out.resolve()) or ".." in cell.folder.parts:
            raise DefectError(f"{cell.folder} is not in {out}")
        if not cell.command.isprintable() and plan.space is None:
            raise DefectError(f"no command of one line: {cell.command!r}")


def run_start(data: bytes) -> None:
    from armwright.spaces.design_file import read_design

    space = a_problem().space
    design = read_design(file_of(data, "design.json"), space)
    space.arm(design)


@cache
def a_problem() -> Problem:
    return Problem(load_task("target-1"))


@cache
def rich_problem() -> Problem:
    (folder() / "rich-space.yaml").write_bytes(RICH_SPACE)
    return Problem(load_task("target-1"), load_space(folder() / "rich-space.yaml"))


def start_seeds() -> list[bytes]:
    space = a_problem().space
    designs = [dict(design.params) for design in space.sample(3, 1)]
    full = {"number": 3, "source": "black box", "objectives": {"torque": 2.0}, "params": designs[0]}
    return [json.dumps({"params": design}).encode() for design in designs] + [json.dumps(full).encode()]


# What models and people answer


def answer_seeds() -> list[bytes]:
    plain, rich = a_problem(), rich_problem()
    found: list[str] = []
    for problem in (plain, rich):
        designs = [dict(design.params) for design in problem.space.sample(3, 2)]
        found += [json.dumps(design) for design in designs]
        found.append(json.dumps({"reasoning": "so", "designs": [{**design, "reason": "why"} for design in designs]}))
        found.append(f"I think so.\n```json\n{json.dumps(designs[0], indent=2)}\n```\nThat is it.")
    found.append(
        "<think>hm</think>\nORIGIN: (0.1, -0.2, 0.0) m\nJOINTS: Y, P, R, P\nLINKS: 0.1 0.2 0.3 0.1 m\nREASON: x"
    )
    found.append("**ORIGIN** = [0, 0, 0]; JOINTS = YPRP; LINKS = L1 = 0.1, L2 = 0.1, L3: .2, L4: 0.25\nEXPECTED: 1, 2")
    found.append('{"origin": [0, 0.1, 0], "joints": "YPRP", "links": ["0.1 m", 0.2, "0.3", 0.1], "expected": [1, 2]}')
    return [text.encode() for text in found]


def run_answer(data: bytes) -> None:
    from armwright.llm.answer import last_json_object, read_answers, read_text, written_answers

    text = data.decode("utf-8", "surrogateescape")
    last_json_object(text)
    found: list[Callable[[], object]] = []
    for problem in (a_problem(), rich_problem()):
        for proposals in (1, 4):

            def read(problem: Problem = problem, proposals: int = proposals) -> None:
                answers = read_text(text, problem, proposals)
                if read_text(written_answers(answers, problem), problem, proposals) != answers:
                    raise DefectError(f"answers that are read back as others: {answers}")

            found.append(read)
        with suppress(ValueError, RecursionError):
            content = json.loads(text)
            if isinstance(content, dict):
                found.append(lambda problem=problem, content=content: read_answers(content, problem))
    any_of(found)


def any_of(reads: Iterable[Callable[[], object]]) -> None:
    """What the first said where all refuse."""
    refusals: list[ArmwrightError] = []
    passed = False
    for read in reads:
        try:
            read()
            passed = True
        except ArmwrightError as refusal:
            check_words(refusal)
            refusals.append(refusal)
    if refusals and not passed:
        raise refusals[0]


def draft_seeds() -> list[bytes]:
    rich = {"task": yaml.safe_load(RICH_TASK), "space": yaml.safe_load(RICH_SPACE)}
    names = ("task", "space")
    plain = {name: yaml.safe_load((ROOT / "examples" / f"2-assembly-{name}.yaml").read_text()) for name in names}
    small = {"name": "drafted", "targets": [[0.4, 0, 0.1], [0.4, 0.2, 0.1]], "provenance": "made up"}
    answers = [
        {**rich, "assumptions": ["one", "two"], "questions": ["three"]},
        {"reasoning": "so", **plain},
        {"task": small, "space": None, "assumptions": "all"},
        {"task": small},
    ]
    return [json.dumps(answer).encode() for answer in answers]


class _Answered:
    """A model that gives one answer."""

    model, origin = "stand-in", "scripted"

    def __init__(self) -> None:
        self.text = ""

    def begin(self) -> None: ...

    def cancel(self) -> None: ...

    def ask(self, question: Any, output: Any = None, most_requests: Any = None) -> Any:
        from armwright.llm.backend import CallError, Reply

        try:
            content = json.loads(self.text)
        except (ValueError, RecursionError):
            content = None
        if not isinstance(content, dict):
            raise CallError("answer", "no object", Reply(self.text, requests=1))
        return Reply(output.read(content), requests=1)


@cache
def drafter(written: bool) -> tuple[Any, _Answered]:
    from armwright.llm.configuration import ConfiguredModel
    from armwright.llm.draft import Drafter

    options = aw.ModelOptions(model="openai-chat:stand-in", base_url="http://127.0.0.1:9/v1", origin="scripted")
    made = Drafter(ConfiguredModel(options, "--model"), folder() / "drafts" / "in" if written else None, force=True)
    answers = _Answered()
    made.backend = answers  # type: ignore[assignment]
    return made, answers


def run_draft(data: bytes) -> None:
    from armwright.llm.transcript import Transcript

    text = data.decode("utf-8", "replace")
    is_written = len(data) % 8 == 0
    made, answers = drafter(is_written)
    made._transcript = Transcript(None)
    answers.text = text
    try:
        draft = made.draft("put it down there")
    finally:
        if is_written:
            outside = [path for path in (folder() / "drafts").iterdir() if path.name != "in"]
            inside = sorted((folder() / "drafts" / "in").iterdir())
            for path in inside:
                path.unlink()
            if outside or len(inside) > 2:
                raise DefectError(f"written elsewhere: {outside} {inside}")
    if _postures(draft.problem) <= MOST_POSTURES:
        draft.problem.evaluate(draft.problem.space.sample(1, 0))
    json.dumps(draft.record(), allow_nan=False)


# Run folders


@cache
def a_run() -> Path:
    """A small run with a model's stand-in and rules, finished, with its page."""
    from armwright.report.page import write_report
    from tests.support.chat_server import ChatServer, designer

    there = folder() / "run"
    with ChatServer() as server:
        server.answer = designer
        proposer = llm_proposer(server.url, memory="own", origin="scripted")
        aw.optimize(a_problem(), proposer=proposer, n_init=3, n_step=2, n_total=4, out=there)
    write_report(there)
    (there / "existing_arms.json").write_text(
        json.dumps(
            [
                {
                    "name": "ur3", "joints": 6, "reach": 0.5, "mass": 11.0, "base": [0.0, 0.0, 0.0],
                    "values": [1.0, 2.0],
                    "measures": {"torque": 2.0, "torque_utilisation": None}, "dominates": 1, "dominated_by": 0,
                    "violated": [], "notes": ["the tip is here"],
                }
            ]
        )
    )  # fmt: skip
    hints = [{"id": 1, "text": "a SCARA arm"}, {"id": 2, "text": "lower"}]
    (there / "control.json").write_text(json.dumps({"paused": True, "stop": False, "hints": hints}))
    return there


@contextmanager
def damaged(name: str, data: bytes) -> Iterator[Path]:
    """The run's folder with this file in the place of its own."""
    there = folder() / "damaged"
    if not there.exists():
        shutil.copytree(a_run(), there)
    (there / name).write_bytes(data)
    try:
        yield there
    finally:
        for changed_file in (name, "control.json", "status.json"):
            shutil.copyfile(a_run() / changed_file, there / changed_file)


def looked_at(there: Path) -> None:
    """What readers of a run folder do."""
    from armwright.experiments.compare_runs import compare_runs
    from armwright.experiments.run_list import list_runs
    from armwright.proposers.replay import ReplayProposer
    from armwright.report.page_content import RunContent
    from armwright.report.tables import markdown
    from armwright.runs.control import Channel, add_hint, read_control, read_status
    from armwright.runs.export import export_design
    from armwright.runs.selection import pick_from

    any_of(
        (
            lambda: json.dumps(list_runs([there])),
            lambda: pick_from(there, robust=True),
            lambda: export_design(there, None, "urdf"),
            lambda: RunContent(there).packed(),
            lambda: markdown(compare_runs(there), "runs", notes=()),
            lambda: replayed(ReplayProposer(there)),
            lambda: (read_control(there), read_status(there)),
            lambda: add_hint(there, "x"),
            lambda: Channel(there).begin(0),
        )
    )


def replayed(proposer: Any) -> None:
    """What a replayed run does with a record."""
    problem = a_problem()
    proposer.check()
    proposer.open(None)
    proposer.recorded_trials()
    proposer.summary()
    json.dumps(dict(proposer.settings()))
    trials = _trials()
    for n in (3, 5):
        history = History(problem, trials[:n], 3, problem.reference_point)
        try:
            proposer.unused(history)
            for proposal in proposer.propose(history, 0, n):
                problem.arm(proposal.design)
        except ArmwrightError:
            if n == 5:
                raise


@cache
def _trials() -> Any:
    from armwright.runs.folder import read_run

    return read_run(a_run())[1].trials


def of_run(name: str) -> Target:
    form = {"yaml": "yaml", "jsonl": "jsonl", "json": "json"}[name.rpartition(".")[2]]

    def run(data: bytes) -> None:
        with damaged(name, data) as there:
            looked_at(there)

    return Target(form, lambda: [(a_run() / name).read_bytes()], run, heavy=True)


def run_replay(data: bytes) -> None:
    from armwright.proposers.replay import ReplayProposer

    place = folder() / "record"
    place.mkdir(exist_ok=True)
    (place / "transcripts.jsonl").write_bytes(data)
    replayed(ReplayProposer(place))


def replay_seeds() -> list[bytes]:
    return [(a_run() / "transcripts.jsonl").read_bytes()]


def run_trials(data: bytes) -> None:
    """trials.jsonl alone, as every reader and a resumed run takes it."""
    from armwright.runs.folder import RunFolder, read_run

    place = folder() / "trials"
    if not place.exists():
        place.mkdir()
        shutil.copy(a_run() / "config.yaml", place)
    (place / "trials.jsonl").write_bytes(data)
    config, history = read_run(place)
    history.front, history.hypervolume
    with RunFolder(place) as run:
        if len(run.open_trials(config)) != len(history):
            raise DefectError("a resumed run has other trials than its readers")


# Arms that exist


def urdf_seeds() -> list[bytes]:
    from tests.support.robots import any_arm, with_frames_anyhow

    with_all = b"""<?xml version="1.0"?>
<robot name="r"><link name="base"><inertial><mass value="1.5"/><origin xyz="0 0 0.1" rpy="0 0 0"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial><visual><geometry>
<cylinder radius="0.1" length="1"/></geometry></visual></link><link name="a"/>
<link name="b"><inertial><mass value="0.5"/></inertial></link><link name="tip"/>
<joint name="j1" type="revolute"><parent link="base"/><child link="a"/><origin xyz="0 0 0.2" rpy="0 0 1.5708"/>
<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="10" velocity="2"/></joint>
<joint name="j2" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/><limit lower="0" upper="0.3"
effort="100" velocity="1"/></joint><joint name="f" type="fixed"><parent link="b"/><child link="tip"/>
<origin xyz="0 0 0.3"/></joint></robot>"""
    return [with_all, *(with_frames_anyhow(any_arm(seed), seed).encode() for seed in range(6))]


def run_urdf(data: bytes) -> None:
    from armwright.robot.urdf_reader import read_urdf
    from armwright.robot.urdf_writer import to_urdf

    read = read_urdf(file_of(data, "arm.urdf"))
    to_urdf(read.arm)
    if len(read.joints) <= 8:
        aw.compare_arms("target-1", [read], base=(0.0, 0.0, 0.0))


# Texts


def run_points(data: bytes) -> None:
    from armwright.exceptions import TaskError
    from armwright.tasks.points_file import read_points
    from armwright.tasks.task_template import task_template
    from armwright.yaml_documents import parse_document

    points = read_points(file_of(data, "points.csv"), "mm", (0.0, 1.0, 0.0))
    parse_document(task_template(Path("x y.yaml"), points), Task, TaskError, "x y.yaml")


def point_seeds() -> list[bytes]:
    return [b"x,y,z\n100,200,300\n# so\n\n1,2,3\n", b"1;2;3\r\n4;5;6\r\n", b"0.1\t2\t3\t4\n", b"\xef\xbb\xbf1 2 3\n"]


def run_words(data: bytes) -> None:
    """Sentences of options and of task files: nothing of them is evaluated."""
    from armwright.problem.constraints import read_constraints
    from armwright.runs.selection import read_condition, read_weights
    from armwright.study.search_budget import SearchBudget

    text = data.decode("utf-8", "replace")
    reads = (read_condition, read_weights, SearchBudget.parse, lambda words: read_constraints(words.split("\n")))
    any_of((lambda read=read: read(text)) for read in reads)


def word_seeds() -> list[bytes]:
    return [b"position_error<=0.05", b"torque>1e3", b"position_error=2,torque=1", b"5s", b"2.5min", b"1e6", b"100_000",
            b"mass <= 3\nlength >= 0.2"]  # fmt: skip


# The page's server


@dataclass
class _Server:
    """The live page's application, spoken to without a network."""

    folder: Path
    token: str = "the-token"
    app: Any = field(init=False)

    def __post_init__(self) -> None:
        from armwright.report.live_app import OpenPages, live_app

        self.app = live_app(self.folder, self.token, lambda host: host == "127.0.0.1:9", OpenPages())

    async def _ask(self, method: str, path: bytes, headers: list[tuple[bytes, bytes]], body: bytes) -> tuple[int, Any]:
        address, _, query = path.partition(b"?")
        scope = {
            "type": "http", "asgi": {"version": "3.0"}, "http_version": "1.1", "method": method, "scheme": "http",
            "path": address.decode("utf-8", "replace"), "raw_path": address, "query_string": query, "root_path": "",
            "headers": headers, "client": ("127.0.0.1", 1), "server": ("127.0.0.1", 9),
        }  # fmt: skip
        parts = [body[:7], body[7:]]
        said: list[Any] = []

        async def receive() -> Any:
            part = parts.pop(0) if parts else b""
            return {"type": "http.request", "body": part, "more_body": bool(parts)}

        async def send(message: Any) -> None:
            said.append(message)

        await self.app(scope, receive, send)
        return said[0]["status"], said[0]["headers"]

    def ask(self, method: str, path: bytes, headers: Mapping[str, str], body: bytes = b"") -> tuple[int, Any]:
        """The status and the headers of an answer."""
        given = [
            (name.lower().encode("latin-1", "replace"), value.encode("latin-1", "replace"))
            for name, value in headers.items()
        ]
        with ThreadPoolExecutor(1) as elsewhere:  # this thread may have a loop already: Playwright's
            return elsewhere.submit(lambda: asyncio.run(self._ask(method, path, given, body))).result()


@cache
def a_server() -> _Server:
    there = folder() / "served"
    shutil.copytree(a_run(), there)
    return _Server(there)


def request_seeds() -> list[bytes]:
    right = {"Host": "127.0.0.1:9", "Origin": "http://127.0.0.1:9", "Content-Type": "application/json",
             "X-Armwright-Token": "the-token"}  # fmt: skip
    wishes = (
        {"action": "pause"},
        {"action": "stop"},
        {"action": "resume"},
        {"action": "hint", "text": "lower, please"},
    )
    posts = [{"method": "POST", "path": "/control", "headers": right, "body": json.dumps(wish)} for wish in wishes]
    paths = ("/run?designs=3&calls=1", "/file?design=2&format=mjcf", "/", "/control")
    gets = [{"method": "GET", "path": path, "headers": {"Host": "127.0.0.1:9"}, "body": ""} for path in paths]
    return [json.dumps(one).encode() for one in (*posts, *posts, *gets)]


def run_request(data: bytes) -> None:
    server = a_server()
    try:
        one = json.loads(data)
        method, path, headers, body = one["method"], one["path"], one["headers"], one["body"]
        headers = {str(name): str(value) for name, value in headers.items()}
    except (ValueError, RecursionError, KeyError, TypeError, AttributeError):
        method, path, headers, body = "POST", "/control", json.loads(request_seeds()[0])["headers"], data
    if isinstance(method, str) and str(path).partition("?")[0] == "/events":
        return  # without an end
    if not isinstance(body, bytes):
        body = (body if isinstance(body, str) else json.dumps(body)).encode("utf-8", "replace")
    before = {path.name for path in server.folder.iterdir()}
    status, sent = server.ask(str(method)[:50], str(path).encode("utf-8", "replace"), headers, body)
    if status >= 500 and not (status == 503):
        raise DefectError(f"{status} for {method} {path}")
    if not {b"x-content-type-options", b"content-security-policy", b"cache-control"} <= {
        bytes(name).lower() for name, _ in sent
    }:
        raise DefectError(f"headers are missing: {sent}")
    if {path.name for path in server.folder.iterdir()} - before - {"control.json", ".control.lock"}:
        raise DefectError("a request made a file")
    control = server.folder / "control.json"
    if control.is_file() and control.stat().st_size > 3_000:
        control.unlink()


# The command line


def argument_seeds() -> list[bytes]:
    run = str(a_run())
    lines = (
        ["tasks", "target-1"], ["tasks", "--json"], ["optimize", "target-1", "--n-total", "2", "--n-init", "1"],
        ["optimize", "target-1", "--sampler", "random", "--objectives", "torque,mass", "--robust", "--seed", "3"],
        ["optimize", "target-1", "--proposer", "rules", "--n-step", "2", "--refine-every", "2", "--json"],
        ["optimize", "target-1", "--proposer", f"replay:{run}", "--model-options",
         "{replay_strict: true, memory: own}"],
        ["optimize", "target-1", "--proposer", "manual:desk", "--prompt", "minus", "--model-options",
         "{wait: false, proposals: 2}"],
        ["optimize", "target-1", "--model", "openai-chat:x", "--max-cost", "0.5", "--model-options",
         "{base_url: 'http://127.0.0.1:9', max_calls: 3, temperature: 0, seed: 1, answer: one-step, output: native}"],
        ["prompt", "target-1", "--model-options", "{memory: own}", "--n-init", "3"],
        ["prompt", "--after", run, "--number", "3"],
        ["prompt", "--template"], ["prompt", "--variables"], ["prompt", "target-1", "--schema"],
        ["design", "target-1", "--budget", "100", "--no-stall", "--seed", "1"],
        ["experiment", "paper", "--seeds", "1", "--task", "target-1", "--method", "bbo", "--print-commands"],
        ["experiment", "rules", "--print"], ["compare", run, "--baseline", "BBO"], ["runs", run, "--json"],
        ["compare-arms", "target-1", "arm.urdf", "--base", "0,0,0.5", "--tip", "tip", "--base-link", "base"],
        ["pick", run, "--where", "torque<=9", "--by", "mass", "-n", "2"], ["pick", run, "--weights", "torque=1"],
        ["export", run, "--design", "2", "--format", "sdf", "--out", "x/y.sdf"], ["report", run],
        ["actuators"], ["doctor", "--model", "openai-chat:x"], ["check", "target-1", "--json"], ["refine", run],
        ["draft", "words", "--print-prompt"], ["init", "new.yaml", "--from", "points.csv", "--unit", "mm"],
        ["init", "new.yaml", "--offset", "0", "0", "1"], ["--version"], ["--help"],
    )  # fmt: skip
    return [json.dumps(line).encode() for line in lines]


NEVER = ("live", "--live", "--call", "--scheduler", "--workers")  # they wait for others, or begin processes


def run_arguments(data: bytes) -> None:
    """A command line, in this process; what would search does so for a few trials."""
    from armwright.cli.app import app

    try:
        content = json.loads(data)
    except (ValueError, RecursionError):
        content = ["tasks", data.decode("utf-8", "replace")]
    listed = content if isinstance(content, list) else [content]
    given = [_argument(one) for one in listed][:40]
    if any(one.partition("=")[0] in NEVER or "--figures".startswith(one) for one in given if one) or (
        given and given[0] in ("report", "refine")
    ):
        return
    if given and given[0] in ("optimize", "design", "experiment", "compare", "compare-arms"):
        given[1:1] = ["--no-figures"]
    if given and given[0] in ("optimize", "design", "experiment"):
        given += (
            {"optimize": ["--n-init=1", "--n-total=2"], "design": ["--budget=50"], "experiment": ["--print-commands"]}[
                given[0]
            ]
            if len(data) % 4
            else ["--out=/dev/null/x"]
        )
    place = folder() / "cli"
    place.mkdir(exist_ok=True)
    if not (place / "arm.urdf").exists():
        (place / "arm.urdf").write_bytes(urdf_seeds()[0])
    (place / "points.csv").write_bytes(point_seeds()[0])
    before = Path.cwd()
    os.chdir(place)
    try:
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            app(given, standalone_mode=False)
    except ArmwrightError:
        raise
    except OSError as fault:  # main() tells of it
        raise RunFolderError(f"cannot: {fault.strerror}") from fault
    except SystemExit as end:
        if end.code not in (None, 0, 1, 2, 130):
            raise DefectError(f"exit code {end.code}") from end
    except Exception as fault:
        if not type(fault).__module__.startswith(("click", "typer")):  # usage errors, which they tell
            raise
    finally:
        os.chdir(before)
        others = sorted(path.name for path in folder().iterdir())
        if set(others) - EXPECTED:
            raise DefectError(f"files beside its folder: {others}")
        for entry in place.iterdir():
            if entry.name not in ("arm.urdf",):
                shutil.rmtree(entry) if entry.is_dir() and not entry.is_symlink() else entry.unlink()


EXPECTED = {"cli", "run", "rich-space.yaml", "damaged", "served", "drafts", "record", "trials", "task.yaml",
    "space.yaml",
            "kept.yaml", "experiment.yaml", "design.json", "arm.urdf", "points.csv", "mine.md.j2"}  # fmt: skip


def _argument(value: Any) -> str:
    """As a shell could give it: no NUL, and what is no text as bytes that are none."""
    text = value if isinstance(value, str) else json.dumps(value)
    return text.replace("\0", "").encode("utf-8", "replace").decode("utf-8")


def _actuators() -> list[bytes]:
    record = {"name": "mine", "maker": "me", "kind": "servo", "voltage": 12.0, "mass": 0.3, "stall_torque": 6.0,
              "rated_torque": 2.0, "peak_torque": 7.0, "speed": 5.0, "width": 0.03, "height": 0.05, "depth": 0.04,
              "price": 120.0, "source": "https://example.org", "note": "so"}  # fmt: skip
    spaces = [
        {"name": "a", "actuators": [record], "actuator_torque": kind, "safety_factor": 2.0}
        for kind in ("stall", "rated", "peak")
    ]
    return [yaml.safe_dump(space).encode() for space in spaces]


TARGETS: dict[str, Target] = {
    "task": Target("yaml", lambda: [RICH_TASK, *shipped("tasks"), *of_examples("task")], run_task, heavy=True),
    "space": Target("yaml", lambda: [RICH_SPACE, *shipped("spaces"), *of_examples("space")], run_space, heavy=True),
    "actuators": Target("yaml", _actuators, run_space, heavy=True),
    "experiment": Target("yaml", lambda: [*shipped("experiments"), *of_examples("rules")], run_experiment, heavy=True),
    "start": Target("json", start_seeds, run_start),
    "answer": Target("json", answer_seeds, run_answer),
    "draft": Target("text", draft_seeds, run_draft, heavy=True),
    "replay": Target("jsonl", replay_seeds, run_replay),
    "trials": Target("jsonl", lambda: [(a_run() / "trials.jsonl").read_bytes()], run_trials),
    **{
        f"run {name}": of_run(name)
        for name in ("config.yaml", "trials.jsonl", "transcripts.jsonl", "summary.json", "existing_arms.json",
                     "control.json", "status.json")
    },
    "urdf": Target("text", urdf_seeds, run_urdf),
    "points": Target("text", point_seeds, run_points),
    "words": Target("text", word_seeds, run_words),
    "request": Target("json", request_seeds, run_request),
    "arguments": Target("json", argument_seeds, run_arguments, heavy=True),
}  # fmt: skip
