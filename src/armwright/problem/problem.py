"""The problem: a design space, a task, and the objectives to minimise."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import SettingsError, TaskError, did_you_mean
from armwright.kinematics.arms.arm_arrays import ArmArrays, Precision
from armwright.kinematics.chunks import in_chunks, threads
from armwright.kinematics.cycle.line_following import IndexArray
from armwright.kinematics.devices import Device, load_all_kernels, resolve_device
from armwright.kinematics.ik.ik import LANES
from armwright.pareto import LARGEST_VIOLATION, NOT_EVALUATED
from armwright.problem.arm_quantities import orientation_error
from armwright.problem.best_chain import best_chain
from armwright.problem.constraints import Constraint, implied_constraints, read_constraints
from armwright.problem.evaluation import Evaluation, evaluate_arrays
from armwright.problem.evaluators import Evaluator, Measurement
from armwright.problem.failure import Failure
from armwright.problem.objective import Need, Objective
from armwright.problem.objectives import PAPER_OBJECTIVES, QUANTITIES, named_objectives
from armwright.problem.outcomes import Outcomes, joined, worst_case
from armwright.problem.scene import Scene, task_scene
from armwright.robot.arm import Arm
from armwright.spaces.arm_builder import stack_designs
from armwright.spaces.base_support import supported_space
from armwright.spaces.design_space import DesignSpace, paper_space
from armwright.spaces.parameters import Design
from armwright.spaces.tolerance import length_columns, perturbed
from armwright.tasks.task import Task

POSTURES_AT_ONCE: dict[Device, int] = {"cpu": 2**17, "cuda": 2**20}  # arms x targets; enough to keep a device busy
SMALLEST_CHUNK = 8  # arms with a cycle; smaller chunks cost a thread more time than they save
CYCLE_KERNELS = (
    ("contact.clearance_kernels", "float32"),
    *((f"cycle.{name}_kernels",) for name in ("branch", "choice", "drive", "dynamics", "load", "path")),
)
NO_MEASUREMENTS: Mapping[str, Array] = {}


@dataclass(frozen=True)
class Problem:
    """Find the arms of a design space that serve a task best.

    Examples:
        >>> import armwright as aw
        >>> problem = aw.Problem(aw.load_task("target-1"), aw.paper_space(joints=4))
        >>> [objective.name for objective in problem.objectives]
        ['position_error', 'torque']
        >>> designs = problem.space.sample(1000, seed=0)
        >>> problem.evaluate(designs).values.shape
        (1000, 2)
    """

    task: Task  # targets, cycle, tool, payloads, obstacles and constraints
    space: DesignSpace = field(default_factory=paper_space)  # the designs to choose from
    # Build tolerance [m]. Above 0, each objective of a design is the worst of the exact arm and of arms with the base
    # or one link off by this much
    tolerance: float = 0.0
    device: Device = "cpu"  # where arms are evaluated; see `resolve_device`
    # What is minimised; by default the task's, else the paper's, with the orientation error if a target states an
    # orientation
    objectives: tuple[Objective, ...] = ()
    evaluator: Evaluator | None = None  # a custom function that measures objectives, such as a simulation
    # The task's and those that its cycle and motor bodies imply, parsed
    constraints: tuple[Constraint, ...] = field(default=(), init=False)

    def __post_init__(self) -> None:
        """Resolve what the base stands on, device, objectives and constraints.

        What the task states of its objectives does not apply to those of an evaluator.

        Raises:
            SpaceError: the base cannot stand on the obstacle that the space names.
            TaskError: reference point or resolution are for other objectives, or a constraint cannot be parsed.
            SettingsError: evaluator, tolerance, objectives and task do not go together.
        """
        if self.evaluator is not None:
            nothing: dict[str, Any] = {"objectives": None, "reference_point": None, "resolution": ()}
            object.__setattr__(self, "task", self.task.model_copy(update=nothing))
        object.__setattr__(self, "space", supported_space(self.space, self.task.obstacles))
        implied = implied_constraints(self.task, self.has_drives, self.space.has_bodies)
        texts = (*self.task.constraints, *implied)
        object.__setattr__(self, "constraints", read_constraints(texts))
        if not self.objectives:
            object.__setattr__(self, "objectives", self._default_objectives())
        if self.evaluator is not None and self.tolerance > 0.0:
            raise SettingsError(f"expected a tolerance or an evaluator, got both ({self.evaluator.name})")
        self._check_custom_parameters()
        for objective in self.objectives:
            if "orientation" in objective.needs and not self.task.target_arrays.oriented:
                raise SettingsError(
                    f"objective {objective.name} needs a target with an axis or an orientation; task {self.task.name} "
                    "has none"
                )
        if self.device not in POSTURES_AT_ONCE:
            object.__setattr__(self, "device", resolve_device(self.device, many=True))
        self._check_task()

    @property
    def has_drives(self) -> bool:
        """True if all joints have actuators whose speeds and voltages are known."""
        actuators = self.space.arm_actuators
        return bool(actuators) and all(None not in (actuator.speed, actuator.voltage) for actuator in actuators)

    def _default_objectives(self) -> tuple[Objective, ...]:
        if self.task.objectives is not None:
            return named_objectives(self.task.objectives)
        if self.evaluator is not None:
            return self.evaluator.objectives
        return (*PAPER_OBJECTIVES, orientation_error) if self.task.target_arrays.oriented else PAPER_OBJECTIVES

    def _check_task(self) -> None:
        """Raise TaskError if what the task states of its objectives is for other ones."""
        point, names = self.reference_point, [objective.name for objective in self.objectives]
        if point is not None and len(point) != len(names):
            raise TaskError(
                f"task {self.task.name}: reference_point: expected {len(names)} values ({', '.join(names)}), got "
                f"{len(point)}; without reference_point the search finds one"
            )
        for name, _ in self.task.resolution:
            if name not in names:
                raise TaskError(
                    f'task {self.task.name}: resolution: "{name}" is not an objective of the task '
                    f"({', '.join(names)}).{did_you_mean(name, names)}"
                )

    def _check_custom_parameters(self) -> None:
        """Raise SettingsError for custom parameters that no evaluator reads, or that are named like a quantity."""
        names = [name for name, _ in self.space.custom]
        for name in names:
            if name in QUANTITIES or name in {objective.name for objective in self.objectives}:
                raise SettingsError(
                    f'space {self.space.name}: parameters: "{name}" is the name of a quantity; try "my_{name}"'
                )
        if names and self.evaluator is not None and not self.evaluator.takes_design:
            raise SettingsError(
                f"{self.evaluator.name}: expected a function (arm, task, design), since the space has the parameters "
                f"{', '.join(names)}, got one without design"
            )

    @property
    def reference_point(self) -> tuple[float, ...] | None:
        """Return the worst values that count for the hypervolume, if the task states them."""
        return self.task.reference_point

    @property
    def quantities(self) -> tuple[Objective, ...]:
        """The objectives, and the quantities that constraints bound."""
        return tuple(dict.fromkeys((*self.objectives, *(constraint.quantity for constraint in self.constraints))))

    def uses(self, *needs: Need) -> bool:
        """Return whether an objective or a bounded quantity depends on any of these."""
        return any(need in quantity.needs for quantity in self.quantities for need in needs)

    def arm(self, design: Design) -> Arm:
        """Return the arm that a design builds, with the task's tool."""
        return self.space.arm(design, self.task.tool)

    def arms(self, matrix: Array, precision: Precision = "float32") -> ArmArrays:
        """Return the arms of N designs with the task's tool, stacked; matrix: (N, P)."""
        return stack_designs(self.space, matrix, self.task.tool, precision)

    def load_kernels(self) -> None:
        """Load all kernels that evaluations along a cycle need, so that none is compiled in the middle of a search."""
        if self.task.cycle is not None:
            kind = "pose" if self.task.target_arrays.oriented else "position"
            ik = ("ik.ik_kernels", "float32", LANES[self.device], "any", kind)
            load_all_kernels([ik, *CYCLE_KERNELS], self.device)

    @property
    def max_reach(self) -> float:
        """The length of the longest possible arm, with its tool and all slides extended [m]."""
        return self.space.max_reach + self.task.tool.length

    def evaluate(
        self, designs: Sequence[Design] | Array, measurements: Sequence[Measurement] | None = None
    ) -> Outcomes:
        """Evaluate N designs: objectives and constraint violations, the worst of all cases and tolerances.

        Args:
            designs: N designs, or (N, P) their matrix, as `DesignSpace.matrix` returns it.
            measurements: what the custom evaluator measured of each; None to call it, if there is one.

        Raises:
            SettingsError: a built-in objective or a violation is not a finite number.
        """
        is_matrix = isinstance(designs, np.ndarray)
        matrix = self.space.normalised(designs) if is_matrix else self.space.matrix(designs)
        measured: dict[str, Array] = {}
        failures: dict[int, Failure] = {}
        if self.evaluator is not None:
            if measurements is None:
                measurements = [
                    self.measure(design) for design in (self.space.designs(matrix) if is_matrix else designs)
                ]
            failures = {row: one for row, one in enumerate(measurements) if isinstance(one, Failure)}
            names = [objective.name for objective in self.evaluator.objectives]
            nothing = (0.0,) * len(names)  # of failed ones
            table = [nothing if isinstance(one, Failure) else one for one in measurements]
            columns = np.array(table, dtype=np.float64).reshape(len(designs), len(names)).T
            measured = dict(zip(names, columns, strict=True))
        parts: dict[int, Outcomes] = {}

        def solve(rows: slice) -> None:
            parts[rows.start] = self._worst_case(matrix[rows], {name: each[rows] for name, each in measured.items()})

        self.load_kernels()
        if self.task.cycle is None:  # whose kernels divide the designs among threads
            for rows in self.chunks(len(matrix)):
                solve(rows)
        else:
            of_thread = max(SMALLEST_CHUNK // self._n_arms, -(-len(matrix) // threads()))
            in_chunks(solve, len(matrix), max(1, min(self._chunk, of_thread)), self.device)
        nobody = Outcomes(np.empty((0, len(self.objectives))), np.empty((0, len(self.constraints))))
        found = joined([parts[first] for first in sorted(parts)]) if parts else nobody
        found.values[list(failures)] = np.inf
        return replace(found, failures=failures)

    def measure(self, design: Design) -> Measurement:
        """Return what the custom evaluator measures of a design, or why it fails."""
        assert self.evaluator is not None
        return self.evaluator.attempt(self.arm(design), self.task, design)

    def physics(
        self, designs: Sequence[Design] | Array | ArmArrays, case: int = 0, entry: Array | None = None
    ) -> Evaluation:
        """Return the kinematics and statics of exact arms at all targets in one case, numbered as in the task.

        The designs may be a matrix (N, P) with values outside the ranges of the space.

        entry: (N, C, B, D) of their outcomes, for the same paths to the bit, or of those of similar arms, which these
            keep as far as they can; None to choose postures.
        """
        if not isinstance(designs, ArmArrays):
            designs = self.arms(designs if isinstance(designs, np.ndarray) else self.space.matrix(designs))
        scene = self.scenes[case]
        if entry is None or scene.plan is None:
            return self._on_best_chain(designs, scene)
        return evaluate_arrays(designs, scene, self.device, candidates=entry[:, case, :, None])

    def cases(self, designs: Sequence[Design] | Array | ArmArrays, entry: Array | None = None) -> list[Evaluation]:
        """Return the `physics` of designs in each case of the task."""
        return [self.physics(designs, case, entry) for case in range(len(self.scenes))]

    @cached_property
    def scenes(self) -> tuple[Scene, ...]:
        """Return the targets and surroundings of each case of the task."""
        return tuple(task_scene(self.task, targets, payloads) for targets, payloads in self.task.cases)

    def outcomes(self, evaluation: Evaluation, measured: Mapping[str, Array] = NO_MEASUREMENTS) -> Outcomes:
        """Return objectives and violations of N evaluated arms; SettingsError if one is not a finite number.

        Objectives that were not evaluated (`CyclePaths`) are infinite.
        `measured` holds (N,) values of each objective that the custom evaluator measures.
        """
        values = [measured[o.name] if o.name in measured else o.minimised(evaluation) for o in self.objectives]
        names = [f"objective {o.name}" for o in self.objectives]
        columns = _finite(values, names, evaluation)
        return Outcomes(columns, self.violations(evaluation), entry=evaluation.entry, q=evaluation.q)

    def violations(self, evaluation: Evaluation) -> Array:
        """Return the (N, C) violations of evaluated arms; SettingsError if one is not a finite number.

        Those that were not evaluated (`CyclePaths`) are NOT_EVALUATED.
        """
        columns = [constraint(evaluation) for constraint in self.constraints]
        table = _finite(columns, [f'constraint "{c.description}"' for c in self.constraints], evaluation)
        return table if evaluation.cycle_paths is None else _ordered(table)

    def known_violations(
        self, evaluation: Evaluation, known: Callable[[Objective, Evaluation], tuple[Array, str]] = Objective.known
    ) -> Array:
        """Return the (N, C) violations of evaluated arms, 0 of quantities that arms or task leave open."""
        columns = [constraint.violation(known(constraint.quantity, evaluation)[0]) for constraint in self.constraints]
        table = np.reshape(columns, (-1, len(evaluation))).T
        return _ordered(np.where(np.isnan(table), np.where(evaluation.is_stopped, np.inf, 0.0)[:, None], table))

    def chunks(self, n: int) -> Iterator[slice]:
        """Yield the rows of n designs that are evaluated at once, so that their postures fit into memory."""
        yield from (slice(first, first + self._chunk) for first in range(0, n, self._chunk))

    def _worst_case(self, matrix: Array, measured: Mapping[str, Array]) -> Outcomes:
        """Return the worst outcomes of designs in each case of the task, exact and off by the tolerance."""
        arms = self.arms(matrix)

        def judge(evaluation: Evaluation, rows: IndexArray) -> Outcomes:
            return self.outcomes(evaluation, {name: column[rows] for name, column in measured.items()})

        exact = worst_case([best_chain(arms, scene, self.constraints, judge, self.device)[1] for scene in self.scenes])
        copies = list(perturbed(self.space, matrix, self.tolerance)) if self.tolerance > 0.0 else []
        if not copies:
            return exact
        entry = None if exact.entry is None else np.tile(exact.entry, (len(copies), 1, 1, 1))
        moved = worst_case(map(self.outcomes, self.cases(self.arms(np.vstack(copies)), entry)))
        values, violations = (
            np.maximum(own, others.reshape(len(copies), *own.shape).max(axis=0))
            for own, others in ((exact.values, moved.values), (exact.violations, moved.violations))
        )
        return replace(exact, values=values, violations=violations)

    def _on_best_chain(self, arms: ArmArrays, scene: Scene) -> Evaluation:
        """Return the physics of N arms on their best chain of postures."""

        def judge(evaluation: Evaluation, _: IndexArray) -> Outcomes:
            nothing = np.empty((len(evaluation), 0))
            return Outcomes(nothing, self.known_violations(evaluation), entry=evaluation.entry)

        first, best = best_chain(arms, scene, self.constraints, judge, self.device)
        if best.entry is None or best.entry is first.entry:
            return first
        return evaluate_arrays(arms, scene, self.device, candidates=best.entry[:, 0, :, None])

    @cached_property
    def _chunk(self) -> int:
        """Return how many designs fit into a chunk by the largest number of postures of one arm."""
        task, plan = self.task, self.scenes[0].plan
        along = 0 if plan is None else 4 * (len(plan.sample().poses) + 33 * len(plan.motions))
        postures = len(task.target_positions) + along + sum(region.points for region in task.workspace)
        return max(1, POSTURES_AT_ONCE[self.device] // (postures * self._n_arms))

    @cached_property
    def _n_arms(self) -> int:
        """Return how many arms a design stands for: itself, and those that are off by the tolerance."""
        return 1 + (2 * len(length_columns(self.space)) if self.tolerance > 0.0 else 0)


def _ordered(violations: Array) -> Array:
    """Return violations that sum up in the order of stages: NOT_EVALUATED for infinite ones, others far below."""
    return np.where(np.isinf(violations), NOT_EVALUATED, np.minimum(violations, LARGEST_VIOLATION))


def _finite(columns: Sequence[Array], names: Sequence[str], evaluation: Evaluation) -> Array:
    """Return (N, K) of K columns, infinite where not evaluated; SettingsError for other values that are not finite."""
    table = np.column_stack(columns) if columns else np.empty((len(evaluation), 0))
    table = np.where(evaluation.is_stopped[:, None] & np.isnan(table), np.inf, table)
    wrong = ~np.isfinite(table) & ~evaluation.is_stopped[:, None]
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        raise SettingsError(
            f"{names[column]}: expected a finite number for every design, got {table[row, column]}; try a large one "
            "for a bad design"
        )
    return table
