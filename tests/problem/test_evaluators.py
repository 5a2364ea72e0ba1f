"""Custom evaluators."""

import asyncio
import math
import os
import signal
import sys
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import armwright as aw
from armwright.exceptions import EvaluatorError, RunConflictError, SettingsError
from armwright.problem.arm_quantities import length, position_error
from armwright.runs.folder import read_run
from tests.support.arms import paper_arms

SPACE = aw.paper_space(joints=3)
TASK = aw.load_task("target-1")
ARM = paper_arms(1, 3, 0)[0]


@aw.evaluator("reach [m]", "joints_used")
def measured(arm: aw.Arm, task: aw.Task) -> tuple[float, float]:
    """Return the reach of the arm."""
    return sum(link.length for link in arm.links), len(arm.joints)


def raising(fault: BaseException) -> aw.Evaluator:
    def measure(arm: aw.Arm, task: aw.Task) -> float:
        raise fault

    return aw.evaluator("energy [J]")(measure)


def test_evaluator_defines_the_objectives() -> None:
    problem = aw.Problem(TASK, SPACE, evaluator=measured)
    assert [(o.name, o.unit, o.label, o.description) for o in problem.objectives] == [
        ("reach", "m", "Reach", "Return the reach of the arm."),
        ("joints_used", "", "Joints used", "Return the reach of the arm."),
    ]
    designs = SPACE.sample(4, 0)
    ours = aw.Problem(TASK.model_copy(update={"reference_point": None}), SPACE, objectives=(length,))
    assert problem.evaluate(designs).values[:, 0] == pytest.approx(ours.evaluate(designs).values[:, 0], abs=1e-9)
    assert problem.evaluate([designs[1]])[0] == problem.evaluate(designs)[1]


def test_evaluator_combines_with_builtin_objectives_and_constraints() -> None:
    task = aw.Task(name="near", targets=((0.3, 0.0, 0.2),), constraints=("length <= 0.5",))
    reach, _ = measured.objectives
    problem = aw.Problem(task, SPACE, objectives=(position_error, reach), evaluator=measured)
    plain = aw.Problem(task, SPACE)
    designs = SPACE.sample(5, 1)
    outcomes = problem.evaluate(designs)
    values, broken = outcomes.values, outcomes.violations
    assert values[:, 0].tolist() == plain.evaluate(designs).values[:, 0].tolist()
    assert broken.tolist() == plain.evaluate(designs).violations.tolist()
    assert values[:, 1] == pytest.approx([sum(link.length for link in problem.arm(d).links) for d in designs])


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (
            lambda arm, task: (1.0, 2.0),
            r"expected 1 numbers \(energy\), got \(1.0, 2.0\) \(test_evaluators.py, line \d+\)$",
        ),
        (lambda arm, task: None, "got None"),
        (lambda arm, task: "much", "got 'much'"),
        (lambda arm, task: math.nan, "expected finite numbers, got energy = nan"),
        (lambda arm, task: np.array([np.inf]), "expected finite numbers, got energy = inf"),
        (lambda arm, task: 10**400, "OverflowError: int too large to convert to float"),
        (lambda arm, task: -1e308, r"expected numbers within ±1e\+60, got energy = -1e\+308"),
        (lambda arm, task: {"energy": 1.0}, "got {'energy': 1.0}"),
        (lambda arm, task: [1.0] * 10**6, r"got \[1.0, 1.0, .{60,75} \(test_evaluators.py"),
        (lambda arm, task: 1 / 0, r": ZeroDivisionError: division by zero \(test_evaluators.py, line \d+\)"),
    ],
)
def test_evaluator_results_are_validated(made: Callable[[aw.Arm, aw.Task], float], words: str) -> None:
    with pytest.raises(EvaluatorError, match=words):
        aw.evaluator("energy [J]")(made)(ARM, TASK)


def test_interrupts_of_an_evaluator_are_raised() -> None:
    with pytest.raises(KeyboardInterrupt):
        raising(KeyboardInterrupt())(ARM, TASK)


class Panic(BaseException):
    """As PyO3 raises it for a panic in Rust."""


class UnprintableError(Exception):
    def __init__(self, show: Callable[[], str]) -> None:
        self.show = show

    def __str__(self) -> str:
        return self.show()


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (asyncio.CancelledError("stop"), "CancelledError: stop"),
        (GeneratorExit(), "GeneratorExit"),
        (SystemExit(3), "SystemExit: 3"),
        (MemoryError(), "MemoryError"),
        (Panic("index out of bounds"), "Panic: index out of bounds"),
        (UnprintableError(lambda: 1 / 0), r"UnprintableError: \(its __str__ raises ZeroDivisionError\)"),
        (UnprintableError(lambda: sys.exit()), r"UnprintableError: \(its __str__ raises SystemExit\)"),
        (UnprintableError(lambda: 3), r"UnprintableError: \(its __str__ raises TypeError\)"),
        (ValueError("much\n" * 2_000_000), "ValueError: (much ){50,}m …"),
    ],
)
def test_any_exception_of_an_evaluator_is_one_line(in_folder: Path, fault: BaseException, words: str) -> None:
    with pytest.raises(EvaluatorError, match=rf": {words} \(test_evaluators.py, line \d+\)\n") as raised:
        raising(fault)(ARM, TASK)
    (trace,) = raised.value.__notes__
    assert len(trace) <= 8_000
    (in_folder / "raises.py").write_text(
        "from tests.problem.test_evaluators import fault\nraise fault.with_traceback(None)\n", encoding="utf-8"
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys.modules[__name__], "fault", fault, raising=False)
        with pytest.raises(SettingsError, match=rf"^cannot load raises.py: {words} \(raises.py, line 2\)$"):
            aw.load_evaluator("raises.py:f")


class NoNumber(Fraction):
    def __float__(self) -> float:
        raise ValueError("no number")


class NoText:
    def __repr__(self) -> str:
        raise asyncio.CancelledError("no text")


@pytest.mark.parametrize(
    ("made", "words"), [(NoNumber(1), "ValueError: no number"), ([NoText()], "CancelledError: no text")]
)
def test_methods_of_a_result_may_raise(made: object, words: str) -> None:
    with pytest.raises(EvaluatorError, match=words):
        aw.evaluator("energy [J]")(lambda arm, task: made)(ARM, TASK)


def test_state_of_the_process_is_restored_after_an_evaluation() -> None:
    def current() -> list[object]:
        streams = [os.fstat(number).st_ino for number in (0, 1, 2)]
        return [Path.cwd(), np.geterr(), sys.getrecursionlimit(), signal.getsignal(signal.SIGTERM), streams]

    @aw.evaluator("energy [J]")
    def careless(arm: aw.Arm, task: aw.Task) -> float:
        os.chdir("/")
        np.seterr(all="raise")
        sys.setrecursionlimit(100_000)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        return 1.0

    before = current()
    assert careless(ARM, TASK) == (1.0,)
    assert current() == before


def test_first_interrupt_stays_the_last_that_an_evaluator_can_catch() -> None:
    """The handler of Ctrl-C sets SIG_DFL, so that a second one ends the process."""
    handler = signal.getsignal(signal.SIGINT)

    @aw.evaluator("energy [J]")
    def interrupted(arm: aw.Arm, task: aw.Task) -> float:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        return 1.0

    try:
        interrupted(ARM, TASK)
        assert signal.getsignal(signal.SIGINT) == signal.SIG_DFL
    finally:
        signal.signal(signal.SIGINT, handler)


def test_what_a_task_states_of_its_objectives_does_not_apply_to_an_evaluator(tmp_path: Path) -> None:
    task = TASK.model_copy(update={"objectives": ("position_error", "torque"), "resolution": (("torque", 0.1),)})
    problem = aw.Problem(task, SPACE, evaluator=aw.evaluator("energy [J]")(lambda arm, task: arm.length))
    assert TASK.reference_point is not None
    assert problem.reference_point is None
    assert [objective.name for objective in problem.objectives] == ["energy"]
    run = aw.optimize(problem, proposer="none", sampler="random", n_init=2, n_total=1, out=tmp_path / "run")
    assert read_run(tmp_path / "run")[1].problem.reference_point is None
    assert len(run.config.reference_point or ()) == 1


def test_failed_evaluation_has_infinite_objectives_and_its_violations() -> None:
    task = TASK.model_copy(update={"constraints": ("length <= 0.5",)})
    designs = SPACE.sample(4, 0)

    @aw.evaluator("energy [J]")
    def some(arm: aw.Arm, task: aw.Task) -> float:
        if arm.base == SPACE.arm(designs[1]).base:
            raise OSError("no licence")
        return math.nan if arm.base == SPACE.arm(designs[2]).base else 1.0

    outcomes = aw.Problem(task, SPACE, evaluator=some).evaluate(designs)
    assert outcomes.values.ravel().tolist() == [1.0, math.inf, math.inf, 1.0]
    assert {row: (one.kind, one.reason) for row, one in outcomes.failures.items()} == {
        1: ("exception", "OSError: no licence"),
        2: ("non_finite", "expected finite numbers, got energy = nan"),
    }
    assert outcomes.violations.tolist() == aw.Problem(task, SPACE).evaluate(designs).violations.tolist()


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: aw.evaluator(), "expected 1 to 5 different names"),
        (lambda: aw.evaluator("a", "a"), "different names"),
        (lambda: aw.evaluator("Energy")(len), "lowercase letters"),
        (lambda: aw.evaluator("torque")(len), "is built in"),
        (lambda: aw.Problem(TASK, SPACE, tolerance=0.001, evaluator=measured), "a tolerance or an evaluator, got both"),
        (
            lambda: aw.optimize(aw.Problem(TASK, SPACE, evaluator=measured), evaluation_timeout=0.0),
            "evaluation_timeout: expected seconds > 0, got 0.0",
        ),
        (lambda: aw.optimize(aw.Problem(TASK, SPACE), evaluation_timeout=1.0), "without --evaluator leave it out"),
    ],
)
def test_evaluator_settings_are_validated(make: Callable[[], object], words: str) -> None:
    with pytest.raises(SettingsError, match=words):
        make()


def test_front_search_refuses_custom_evaluators(tmp_path: Path) -> None:
    problem = aw.Problem(TASK, SPACE, evaluator=measured)
    with pytest.raises(SettingsError, match="only in `armwright optimize`"):
        aw.find_front(problem, evaluations=100, out=tmp_path / "front")


FILE = """
import armwright as aw
from beside import FACTOR

@aw.evaluator("reach [m]", "droop [m]")
def simulate(arm, task):
    return FACTOR * sum(link.length for link in arm.links), arm.base[2] + 1.0

def plain(arm, task):
    return 1.0
"""


@pytest.fixture
def file(in_folder: Path) -> Path:
    (in_folder / "beside.py").write_text("FACTOR = 2.0\n", encoding="utf-8")
    (in_folder / "sim.py").write_text(FILE, encoding="utf-8")
    return in_folder / "sim.py"


def test_evaluator_file_can_import_its_neighbours(file: Path) -> None:
    loaded = aw.load_evaluator(f"{file}:simulate")
    assert loaded.name == "sim.py:simulate"
    assert len(loaded.version) == 12
    assert loaded(ARM, TASK)[0] == pytest.approx(2 * sum(link.length for link in ARM.links))


@pytest.mark.parametrize(
    ("place", "words"),
    [
        ("sim.py", "expected FILE.py:FUNCTION or MODULE:FUNCTION, got"),
        ("nothing.py:simulate", "there is no such file"),
        ("no_module_of_that_name:simulate", "cannot load no_module_of_that_name: ModuleNotFoundError"),
        ("sim.py:plain", "is a plain function: put @armwright.evaluator"),
        ("sim.py:simulat", 'Did you mean "simulate"'),
        ("broken.py:f", r"cannot load broken.py: SyntaxError: .*\(broken.py, line 2\)"),
        ("raises.py:f", r"cannot load raises.py: RuntimeError: at once \(raises.py, line 1\)"),
        ("exits.py:f", r"cannot load exits.py: SystemExit: 3 \(exits.py, line 1\)"),
        ("named.py:f", r'^cannot load named.py: objective "length" is built in; .* \(named.py, line 2\)$'),
    ],
)
def test_unloadable_evaluator_is_one_line(file: Path, place: str, words: str) -> None:
    (file.parent / "broken.py").write_text("x = 1\ndef f(:\n", encoding="utf-8")
    (file.parent / "raises.py").write_text("raise RuntimeError('at once')\n", encoding="utf-8")
    (file.parent / "exits.py").write_text("raise SystemExit(3)\n", encoding="utf-8")
    (file.parent / "named.py").write_text(
        "import armwright as aw\n@aw.evaluator('length')\ndef f(arm, task): ...\n", encoding="utf-8"
    )
    with pytest.raises(SettingsError, match=words) as raised:
        aw.load_evaluator(place)
    assert "\n" not in str(raised.value)


@pytest.mark.slow
def test_run_is_resumed_with_its_own_evaluator(file: Path) -> None:
    """A changed evaluator file is noted; the run folder names the file but never loads it."""
    task = TASK

    def run(n_total: int, evaluator: aw.Evaluator | None) -> aw.StudyResult:
        problem = aw.Problem(task, SPACE, evaluator=evaluator)
        return aw.optimize(problem, proposer="rules", n_init=5, n_total=n_total, out="runs/own")

    first = run(5, aw.load_evaluator("sim.py:simulate"))
    (file.parent / "sim.py").write_text(FILE + "# mended\n", encoding="utf-8")
    more = run(8, aw.load_evaluator("sim.py:simulate"))
    assert [t.values for t in more.trials[:10]] == [t.values for t in first.trials]
    assert [v["evaluator"] for v in more.config.earlier_versions] == [first.config.versions["evaluator"]]
    with pytest.raises(RunConflictError, match=r"evaluator: sim\.py:simulate stored, None requested"):
        run(8, None)
    (file.parent / "sim.py").unlink()
    config, history = read_run("runs/own")
    assert config.evaluator == "sim.py:simulate"
    assert history.values.shape == (13, 2)
