"""Custom evaluators: Python functions, such as simulations, that measure an arm in place of the built-in objectives.

@evaluator("settling_error [m]", "energy [J]")
def simulate(arm, task):
    ...
    return error, energy

A function with a third argument, `design`, also gets the parameters that do not change the arm: design.params["kp"].
"""

import hashlib
import importlib
import inspect
import linecache
import math
import re
import sys
import sysconfig
from collections.abc import Callable, Iterable, Sequence
from contextvars import copy_context
from dataclasses import dataclass, field, replace
from importlib.util import decode_source
from numbers import Real
from pathlib import Path
from types import ModuleType
from typing import Any, cast

import numpy as np

from armwright.arrays import LARGEST_OBJECTIVE, Array
from armwright.exceptions import EvaluatorError, SettingsError, did_you_mean
from armwright.problem.evaluation import Evaluation
from armwright.problem.failure import Failure
from armwright.problem.objective import Objective
from armwright.problem.objectives import MAX_OBJECTIVES, OBJECTIVES
from armwright.robot.arm import Arm
from armwright.spaces.parameters import Design
from armwright.tasks.task import Task
from armwright.text import one_line
from armwright.user_code import MAX_REASON_LENGTH, contained, describe_exception, place_of, traceback_of

Measure = Callable[[Arm, Task], Sequence[float] | float] | Callable[[Arm, Task, Design], Sequence[float] | float]
Measurement = tuple[float, ...] | Failure  # the objectives of one arm, or why there are none

DESIGN = "design"  # name of the argument of a function that takes the design, too

NAMED = re.compile(r"([a-z][a-z0-9_]*)(?: \[([^\[\]]{1,40})\])?")  # such as "energy [J]"
MAX_NAME_LENGTH = 40


@dataclass(frozen=True)
class Evaluator:
    """A function that measures an arm for a task; each number is an objective, minimised."""

    name: str  # `file.py:function` or `module:function`, as stored in the settings of a run
    measure: Measure
    objectives: tuple[Objective, ...]  # the objectives that it measures
    version: str = field(default="", compare=False)  # part of the sha256 of its file; empty without a file
    place: str = field(default="", compare=False)  # the argument of `load_evaluator`
    # Content of the file. A pickle holds it, so that other processes need no copy
    source: bytes = field(default=b"", compare=False, repr=False)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle a file by its source, a module's evaluator by name, and any other by value."""
        where, _, function = (self.place or self.name).rpartition(":")
        if self.source:
            return _from_source, (f"{Path(where).resolve()}:{function}", self.source)
        if where != "__main__" and (self.place or getattr(sys.modules.get(where), function, None) is self):
            return load_evaluator, (f"{where}:{function}",)
        return Evaluator.__new__, (Evaluator,), self.__dict__

    @property
    def takes_design(self) -> bool:
        """Whether the function has the argument `design`."""
        return DESIGN in inspect.signature(self.measure).parameters

    def __call__(self, arm: Arm, task: Task, design: Design | None = None) -> tuple[float, ...]:
        """Return the objectives of an arm; EvaluatorError if the function fails or exits.

        `design` is what the arm was built from, for a function that takes it.
        """
        measured = self.attempt(arm, task, design)
        if not isinstance(measured, Failure):
            return measured
        raise evaluator_error(f"{self.name}: {measured.description}", measured)

    def attempt(self, arm: Arm, task: Task, design: Design | None = None) -> Measurement:
        """Return the objectives of an arm, or why there are none; the arguments are those of a call."""
        given: dict[str, Any] = {DESIGN: design} if self.takes_design else {}
        try:
            with contained():
                return self._measurement(
                    copy_context().run(cast("Callable[..., object]", self.measure), arm, task, **given)
                )
        except KeyboardInterrupt:
            raise
        except BaseException as fault:  # noqa: BLE001 (the failure is recorded; user code may raise anything)
            kind = type(fault).__name__
            return Failure("exception", describe_exception(fault), kind, place_of(fault), traceback_of(fault))

    def _measurement(self, made: object) -> Measurement:
        """Check what the function returned."""
        names = [objective.name for objective in self.objectives]
        several = list(cast("Iterable[object]", made)) if isinstance(made, (tuple, list, np.ndarray)) else [made]
        values = tuple(float(one) for one in several if isinstance(one, Real))
        if not len(values) == len(several) == len(names):
            return self._wrong_result(f"expected {len(names)} numbers ({', '.join(names)}), got {made!r:.80}")
        for name, value in zip(names, values, strict=True):
            if not abs(value) <= LARGEST_OBJECTIVE:
                limit = "finite numbers" if not math.isfinite(value) else f"numbers within ±{LARGEST_OBJECTIVE:g}"
                return Failure("non_finite", f"expected {limit}, got {name} = {value}")
        return values

    def _wrong_result(self, reason: str) -> Failure:
        return Failure("exception", one_line(reason, MAX_REASON_LENGTH), "wrong result", _defined_at(self.measure))


def evaluator_error(message: str, failure: Failure) -> EvaluatorError:
    """Return the error of a failed evaluation, with the traceback of the evaluator's code as a note."""
    error = EvaluatorError(message)
    if failure.traceback:
        error.add_note(failure.traceback)
    return error


def evaluator(*objectives: str) -> Callable[[Measure], Evaluator]:
    """Make an evaluator of a function `(arm, task) -> numbers`, one for each of the objectives.

    Objectives are names, each with its unit in brackets if it has one: "energy [J]". An arm for which the function
    raises, or returns other than finite numbers, is infeasible. A function `(arm, task, design) -> numbers` also gets
    the design, whose `params` hold the custom parameters.

    Examples:
        >>> @evaluator("reach [m]")
        ... def shortest(arm, task):
        ...     return sum(link.length for link in arm.links)
        >>> shortest.objectives[0].unit
        'm'
    """
    if not 1 <= len(objectives) <= MAX_OBJECTIVES or len(set(objectives)) < len(objectives):
        raise SettingsError(f"evaluator({', '.join(objectives)}): expected 1 to {MAX_OBJECTIVES} different names")

    def decorated(measure: Measure) -> Evaluator:
        name = f"{measure.__module__}:{measure.__qualname__}"
        summary = (measure.__doc__ or f"what {measure.__qualname__} measures").split("\n\n")[0]
        description = " ".join(summary.split())
        return Evaluator(name, measure, tuple(_objective(given, description, name) for given in objectives))

    return decorated


def load_evaluator(place: str) -> Evaluator:
    """Load the evaluator `file.py:function` or `module:function`, running its code; SettingsError if there is none."""
    where, _, function = place.rpartition(":")
    if not where or not function:
        raise SettingsError(f'--evaluator: expected FILE.py:FUNCTION or MODULE:FUNCTION, got "{place}"')
    if where.endswith(".py"):
        if not Path(where).is_file():
            raise SettingsError(f"cannot read {where}: there is no such file")
        return _from_source(place, Path(where).read_bytes())
    module = _loaded(lambda: importlib.import_module(where), where)
    found = _found(module, where, function)
    file = getattr(module, "__file__", None)
    version = "" if file is None else _version(Path(file).read_bytes())
    return replace(found, name=f"{where}:{function}", version=version, place=place)


def _from_source(place: str, source: bytes) -> Evaluator:
    """Load the evaluator of `file.py:function`, whether or not the file is here."""
    where, _, function = place.rpartition(":")
    module = _loaded(lambda: _run_file(Path(where), source), where)
    found = _found(module, where, function)
    name = f"{Path(where).name}:{function}"
    return replace(found, name=name, version=_version(source), place=place, source=source)


def _version(source: bytes) -> str:
    return hashlib.sha256(source).hexdigest()[:12]


def _found(module: ModuleType, where: str, function: str) -> Evaluator:
    """Return the evaluator `function` of a module; SettingsError if there is none."""
    found = getattr(module, function, None)
    if isinstance(found, Evaluator):
        return found
    if callable(found):
        raise SettingsError(
            f'{where}:{function} is a plain function: put @armwright.evaluator("OBJECTIVE [UNIT]", ...) above it'
        )
    there = [name for name, value in vars(module).items() if isinstance(value, Evaluator)]
    known = f"Evaluators there: {', '.join(there)}" if there else "There is no evaluator"
    raise SettingsError(f"{where} has no evaluator {function}.{did_you_mean(function, there)} {known}")


def _objective(given: str, description: str, name: str) -> Objective:
    """Return the objective of a name with a unit; its value comes from the evaluator alone."""
    match = NAMED.fullmatch(given)
    if match is None or len(match[1]) > MAX_NAME_LENGTH:
        raise SettingsError(
            f'objective "{given}": expected at most {MAX_NAME_LENGTH} lowercase letters, digits and _, then the unit '
            'in brackets if there is one; try "energy [J]"'
        )
    own, unit = match[1], match[2] or ""
    if own in OBJECTIVES:
        raise SettingsError(f'objective "{own}" is built in; give another name')

    def each(_: Evaluation) -> Array:
        raise SettingsError(f"{own} is measured by {name}, design by design, and only in `armwright optimize`")

    return Objective(own, unit, description, each, over="arm")


def _loaded(load: Callable[[], ModuleType], where: str) -> ModuleType:
    """Return a module of users, whose code changes nothing here, such as `numpy.seterr`; SettingsError if it fails."""
    try:
        with contained():
            return copy_context().run(load)
    except KeyboardInterrupt:
        raise
    except BaseException as fault:
        place = ""
        if where.endswith(".py"):  # a decorator of ours raises SettingsError for an argument in the file
            place = f" ({place_of(fault, where if isinstance(fault, SettingsError) else '')})"
        reason = str(fault) if isinstance(fault, SettingsError) else describe_exception(fault)
        raise SettingsError(f"cannot load {where}: {reason}{place}") from fault


def _run_file(path: Path, source: bytes) -> ModuleType:
    """Run a Python file as a module; it can import its neighbours, but they hide no module of Python's own."""
    folder = str(path.resolve().parent)
    if folder not in sys.path:
        own = Path(sysconfig.get_path("stdlib"))
        last = max((n for n, place in enumerate(sys.path) if Path(place) in (own, own / "lib-dynload")), default=-1)
        sys.path.insert(last + 1, folder)
    name = f"armwright_evaluator_{path.stem}"
    module = sys.modules[name] = ModuleType(name)  # as pickle and dataclasses expect
    module.__file__ = str(path)
    text = decode_source(source)
    linecache.cache[str(path)] = len(text), None, text.splitlines(keepends=True), str(path)  # for tracebacks
    exec(compile(text, path, "exec"), vars(module))
    return module


def _defined_at(measure: Measure) -> str:
    """Return where a function is defined: `file.py, line 12`; empty for an object that is called."""
    code = getattr(measure, "__code__", None)
    return "" if code is None else f"{Path(code.co_filename).name}, line {code.co_firstlineno}"
