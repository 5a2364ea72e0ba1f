"""Custom evaluators: Python functions, such as simulations, that measure an arm in place of the built-in objectives.

@evaluator("settling_error [m]", "energy [J]")
def simulate(arm, task):
    ...
    return error, energy

A function with a third argument, `design`, also gets the parameters that do not change the arm: design.params["kp"].
"""

import hashlib
import importlib
import importlib.abc
import importlib.util
import inspect
import math
import re
import sys
import sysconfig
from collections.abc import Callable, Sequence
from contextvars import Context, copy_context
from dataclasses import dataclass, field, replace
from numbers import Real
from pathlib import Path
from types import ModuleType
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

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
from armwright.user_code import MAX_REASON_LENGTH, ForkError, contained, describe_exception, place_of, traceback_of

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
    # The state that its file set when it was imported, such as `numpy.seterr`; applies to its calls only
    context: Context | None = field(default=None, compare=False, repr=False)

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

        Args:
            arm: The arm.
            task: The task.
            design: The design that the arm was built from, for a function that takes it.
        """
        measured = self.attempt(arm, task, design)
        if not isinstance(measured, Failure):
            return measured
        raise evaluator_error(f"{self.name}: {measured.description}", measured)

    def attempt(self, arm: Arm, task: Task, design: Design | None = None) -> Measurement:
        """Return the objectives of an arm, or why there are none; the arguments are those of a call."""
        given: dict[str, Any] = {DESIGN: design} if self.takes_design else {}
        context = copy_context() if self.context is None else self.context.copy()
        try:
            with contained():
                return self._measurement(context.run(cast("Callable[..., object]", self.measure), arm, task, **given))
        except KeyboardInterrupt:
            raise
        except ForkError as fault:
            return self._wrong_result(str(fault))
        except BaseException as fault:  # noqa: BLE001 (the failure is recorded; user code may raise anything)
            kind = type(fault).__name__
            return Failure("exception", describe_exception(fault), kind, place_of(fault), traceback_of(fault))

    def _measurement(self, made: object) -> Measurement:
        """Check what the function returned."""
        names = [objective.name for objective in self.objectives]
        values = _numbers(made)
        if len(values) != len(names):
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

    An arm for which the function raises, or returns other than finite numbers, is infeasible. A function
    `(arm, task, design) -> numbers` also gets the design, whose `params` hold the custom parameters.

    Args:
        objectives: Names, each with its unit in brackets if it has one: "energy [J]".

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
    """Load the evaluator `file.py:function` or `module:function`, which runs its code.

    Raises:
        SettingsError: There is none.
    """
    where, _, function = place.rpartition(":")
    if not where or not function:
        raise SettingsError(f'--evaluator: expected FILE.py:FUNCTION or MODULE:FUNCTION, got "{place}"')
    if where.endswith(".py"):
        if not Path(where).is_file():
            raise SettingsError(f"cannot read {where}: there is no such file")
        return _from_source(place, Path(where).read_bytes())
    module, context = _loaded(_module, where)
    found = _found(module, where, function)
    file = getattr(module, "__file__", None)
    version = "" if file is None else _version(Path(file).read_bytes())
    return replace(found, name=f"{where}:{function}", version=version, place=place, context=context)


def _from_source(place: str, source: bytes) -> Evaluator:
    """Load the evaluator of `file.py:function`, whether or not the file is here."""
    where, _, function = place.rpartition(":")
    module, context = _loaded(_file_module, Path(where), source)
    found = _found(module, where, function)
    name = f"{Path(where).name}:{function}"
    return replace(found, name=name, version=_version(source), place=place, source=source, context=context)


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


def _numbers(made: object) -> tuple[float, ...]:
    """Return the numbers that a function returned; empty if it returned anything else."""
    if isinstance(made, np.ndarray):
        made = cast("NDArray[Any]", made).tolist()
    several = list(cast("tuple[object, ...]", made)) if isinstance(made, (tuple, list)) else [made]
    numbers = [_number(one) for one in several if isinstance(one, Real)]
    return tuple(numbers) if len(numbers) == len(several) else ()


def _number(one: Real) -> float:
    try:
        return float(one)
    except OverflowError:
        return math.inf


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


def _loaded(load: Callable[..., ModuleType], *arguments: object) -> tuple[ModuleType, Context]:
    """Return a module of users, and the context that its code left behind."""
    context = copy_context()
    return context.run(load, *arguments), context


def _module(name: str) -> ModuleType:
    try:
        with contained():
            return importlib.import_module(name)
    except KeyboardInterrupt:
        raise
    except BaseException as fault:
        raise SettingsError(f"cannot import {name}: {describe_exception(fault)}") from fault


class _Source(importlib.abc.SourceLoader):
    """Loads a module from source in memory; tracebacks show its lines where the file is missing."""

    def __init__(self, path: Path, source: bytes) -> None:
        self._path = path
        self._source = source

    def get_filename(self, fullname: str) -> str:
        return str(self._path)

    def get_data(self, path: str) -> bytes:
        return self._source


def _file_module(path: Path, source: bytes) -> ModuleType:
    """Import a Python file as a module; it can import its neighbours, but they hide no module of Python's own."""
    name = f"armwright_evaluator_{path.stem}"
    folder = str(path.resolve().parent)
    if folder not in sys.path:
        own = Path(sysconfig.get_path("stdlib"))
        last = max((n for n, place in enumerate(sys.path) if Path(place) in (own, own / "lib-dynload")), default=-1)
        sys.path.insert(last + 1, folder)
    spec = importlib.util.spec_from_loader(name, _Source(path, source))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # as pickle and dataclasses expect
    try:
        with contained():
            spec.loader.exec_module(module)
    except KeyboardInterrupt:
        raise
    except SettingsError as fault:  # raised by our decorator for an argument in the file
        raise SettingsError(f"cannot load {path}: {fault} ({place_of(fault, str(path))})") from fault
    except BaseException as fault:
        raise SettingsError(f"cannot load {path}: {describe_exception(fault)} ({place_of(fault)})") from fault
    return module


def _defined_at(measure: Measure) -> str:
    """Return where a function is defined: `file.py, line 12`; empty for an object that is called."""
    code = getattr(measure, "__code__", None)
    return "" if code is None else f"{Path(code.co_filename).name}, line {code.co_firstlineno}"
