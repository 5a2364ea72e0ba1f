"""What searching arm and controller together is worth, at equal numbers of simulations.

    python benchmarks/codesign.py --file codesign.jsonl [--seeds 10] [--budgets 60 200] [--sampler tpe]
    python benchmarks/codesign.py --file codesign.jsonl --resimulate

The evaluator is examples/design_and_control.py. Methods:

- together: the sampler over arm, gears and controller;
- design first: the front of cycle time and thermal utilisation by our own physics, with bare drives, then the sampler
  over gears and controller of three arms of it, from the fastest to the coolest, with a third of the simulations each;
- random: uniform over arm, gears and controller.

Nothing is proposed by rules or models.

The figure is the hypervolume of the feasible designs within REFERENCE. Each finished run is one line of the file; runs
that it holds are not repeated, so a file is for one sampler. Paired Wilcoxon tests over the seeds, corrected by Holm.

With --resimulate, the designs of all fronts are simulated again by the forward dynamics of Pinocchio with the same
controller; the second engine integrates with another scheme and another model of friction.
"""

import argparse
import itertools
import json
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
from scipy.stats import spearmanr

import armwright as aw
from armwright.experiments.statistics import holm, interval, paired_test
from armwright.pareto import front_mask
from armwright.problem.objectives import named_objectives

EXAMPLES = Path(__file__).parent.parent / "examples"
sys.path.insert(0, str(EXAMPLES))
import design_and_control as example  # noqa: E402

METHODS = ("together", "design first", "random")
REFERENCE = (2.0, 400.0, 50.0)  # s, J, mm
N_RANDOM = 10  # trials before the sampler
ARMS = 3  # of the method that designs first
FIRST_EVALUATIONS = 4000  # by our physics
SUBSTEPS = 20  # of Pinocchio in a period of the controller
SLIP = 0.02  # speed at which Coulomb friction has three quarters of its value [rad/s]


@dataclass(frozen=True)
class Cell:
    """One run."""

    method: str
    budget: int
    seed: int
    sampler: str


def problem_in(space: aw.DesignSpace) -> aw.Problem:
    """The task of the example in a space."""
    task = aw.load_task(str(EXAMPLES / "9-codesign-task.yaml"))
    return aw.Problem(task, space, evaluator=aw.load_evaluator(f"{EXAMPLES}/design_and_control.py:drive"))


def whole_space() -> aw.DesignSpace:
    return aw.load_space(EXAMPLES / "9-codesign-space.yaml")


def run(cell: Cell) -> list[aw.FinishedTrial]:
    """The trials of a run."""
    if cell.method == "design first":
        return [trial for study in after_design(cell) for trial in study]
    sampler = "random" if cell.method == "random" else cell.sampler
    return searched(whole_space(), cell.budget, cell.seed, sampler)


def searched(space: aw.DesignSpace, budget: int, seed: int, sampler: str) -> list[aw.FinishedTrial]:
    n_init = min(N_RANDOM, budget // 2)
    sizes = {"n_init": n_init, "n_total": budget - n_init}
    found = aw.optimize(problem_in(space), sampler=sampler, proposer="none", seed=seed, **sizes)
    return list(found.trials)


def after_design(cell: Cell) -> Iterator[list[aw.FinishedTrial]]:
    """Yield the trials of each arm that was designed first."""
    space = whole_space()
    bare = space.model_copy(update={"custom": ()})
    task = aw.load_task(str(EXAMPLES / "9-codesign-task.yaml"))
    first = aw.Problem(task, bare, objectives=named_objectives(("cycle_time", "thermal_utilisation")))
    front = aw.find_front(first, evaluations=FIRST_EVALUATIONS, seed=cell.seed).front
    chosen = [front[i] for i in np.linspace(0, len(front) - 1, ARMS).round().astype(int)]
    for number, member in enumerate(chosen):
        fixed = {**dict(space.restrict), **member.design.params}
        space_of_arm = space.model_copy(update={"restrict": tuple(fixed.items())})
        budget = cell.budget // ARMS + (number < cell.budget % ARMS)
        yield searched(space_of_arm, budget, ARMS * cell.seed + number, cell.sampler)


def record(cell: Cell) -> dict[str, Any]:
    """A run as a line of the file: its hypervolume and the designs of its front."""
    started = time.monotonic()
    trials = run(cell)
    feasible = [trial for trial in trials if not any(violation > 0.0 for violation in trial.violations)]
    values = np.array([trial.values for trial in feasible]).reshape(-1, len(REFERENCE))
    front = [trial for trial, on_front in zip(feasible, front_mask(values), strict=True) if on_front]
    return {
        **vars(cell),
        "simulations": len(trials),
        "feasible": len(feasible),
        "hypervolume": aw.hypervolume(values, REFERENCE) if len(values) else 0.0,
        "seconds": round(time.monotonic() - started, 1),
        "front": [{"params": dict(trial.design.params), "values": list(trial.values)} for trial in front],
    }


class PinocchioEngine:
    """The forward dynamics of Pinocchio, with friction of the drives and a payload at the tip."""

    def __init__(self, arm: aw.Arm, q: np.ndarray, full: float, task: aw.Task) -> None:
        self.models = []
        for mass in (0.0, full):
            model = pinocchio.buildModelFromXML(aw.to_urdf(arm))
            frame = model.frames[model.getFrameId("tip")]
            shape = task.load_shape
            body = pinocchio.Inertia(mass, np.array(shape.center), mass * np.diag(shape.gyration))
            model.appendBodyToJoint(frame.parentJoint, body, frame.placement)
            self.models.append((model, model.createData()))
        motors = [joint.actuator for joint in arm.joints if joint.actuator is not None]
        self.rotor, self.coulomb, self.viscous = np.array(
            [(m.rotor_inertia or 0.0, m.coulomb_friction or 0.0, m.viscous_friction or 0.0) for m in motors]
        ).T
        self.q, self.qd = q.copy(), np.zeros(len(q))
        self.model, self.data = self.models[0]
        self.frame = self.model.getFrameId("tip")

    def state(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        weight = pinocchio.nonLinearEffects(self.model, self.data, self.q, self.qd)
        return self.q.copy(), self.qd.copy(), weight.copy()

    def tip(self, q: np.ndarray) -> np.ndarray:
        pinocchio.framesForwardKinematics(self.model, self.data, q)
        return self.data.oMf[self.frame].translation.copy()

    def carry(self, mass: float) -> None:
        self.model, self.data = self.models[int(mass > 0.0)]

    def step(self, torque: np.ndarray) -> None:
        time_step = example.PERIOD / SUBSTEPS
        for _ in range(SUBSTEPS):
            inertia = pinocchio.crba(self.model, self.data, self.q)
            inertia = np.triu(inertia) + np.triu(inertia, 1).T + np.diag(self.rotor)
            weight = pinocchio.nonLinearEffects(self.model, self.data, self.q, self.qd)
            # Friction is taken at the end of the step, so that it cannot reverse the motion.
            drag = self.viscous + self.coulomb / np.maximum(np.abs(self.qd), SLIP)
            momentum = inertia @ self.qd + time_step * (torque - weight)
            self.qd = np.linalg.solve(inertia + time_step * np.diag(drag), momentum)
            self.q = pinocchio.integrate(self.model, self.q, time_step * self.qd)


def resimulated(params: dict[str, Any]) -> list[float]:
    """The objectives of a design in Pinocchio."""
    problem = problem_in(whole_space())
    design = problem.space.design(params)
    arm = example.geared(problem.arm(design), design)
    model = aw.cycle_model(arm, problem.task)
    plan = example.paced(model, design)
    engine = PinocchioEngine(arm, plan.q[0], float(plan.payload.max()), problem.task)
    kp, kd = float(design.params["kp"]), float(design.params["kd"])
    return [plan.duration, *example.follow(engine, plan, example.Drives.of(arm), kp, kd)]


def compare_engines(file: Path, most: int) -> None:
    """Print the rank correlation of the engines over the designs of all fronts."""
    members = [member for line in read(file) for member in line.get("front", ())]
    rows = np.unique(np.linspace(0, len(members) - 1, most).round().astype(int))
    first = np.array([members[i]["values"] for i in rows])
    second = np.array([resimulated(members[i]["params"]) for i in rows])
    print(f"{len(rows)} of {len(members)} designs of the fronts, MuJoCo against Pinocchio:")
    for k, name in enumerate(("duration", "energy", "tracking error")):
        ratio = second[:, k] / first[:, k]
        print(
            f"  {name:<15} rank correlation {spearmanr(first[:, k], second[:, k]).statistic:.3f}, "
            f"ratio {np.median(ratio):.3f} [{np.quantile(ratio, 0.05):.3f}, {np.quantile(ratio, 0.95):.3f}]"
        )


def read(file: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()] if file.exists() else []


def summarize(file: Path) -> None:
    """Print mean hypervolumes and the paired tests."""
    found = {(line["method"], line["budget"], line["seed"]): line for line in read(file)}
    labels, tests = [], []
    for budget in sorted({budget for _, budget, _ in found}):
        volumes = {
            method: {seed: line["hypervolume"] for (m, b, seed), line in found.items() if (m, b) == (method, budget)}
            for method in METHODS
        }
        for method, by_seed in volumes.items():
            if by_seed:
                mean = interval(list(by_seed.values()))
                print(
                    f"{budget:>4} {method:<13} {mean.mean:9.0f} [{mean.low:.0f}, {mean.high:.0f}], {len(by_seed)} seeds"
                )
        for one, other in itertools.combinations(METHODS, 2):
            seeds = sorted(volumes[one].keys() & volumes[other].keys())
            if seeds:
                labels.append(f"{budget:>4} {one} against {other}")
                tests.append(paired_test(*([volumes[method][seed] for seed in seeds] for method in (one, other))))
    for label, test, p in zip(labels, tests, holm([test.p for test in tests]), strict=True):
        print(
            f"{label:<34} better in {test.better} of {test.n}, effect {test.effect:+.2f}, p {test.p:.4f}, Holm {p:.4f}"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--file", type=Path, required=True)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--budgets", type=int, nargs="+", default=[60, 200])
    parser.add_argument("--sampler", default="tpe")
    parser.add_argument("--resimulate", action="store_true")
    parser.add_argument("--most", type=int, default=200, help="designs to simulate again")
    options = parser.parse_args()
    if options.resimulate:
        compare_engines(options.file, options.most)
        return
    done = {(line["method"], line["budget"], line["seed"]) for line in read(options.file)}
    for seed, budget, method in itertools.product(range(options.seeds), options.budgets, METHODS):
        if (method, budget, seed) not in done:
            with options.file.open("a", encoding="utf-8") as file:
                file.write(json.dumps(record(Cell(method, budget, seed, options.sampler))) + "\n")
    summarize(options.file)


if __name__ == "__main__":
    main()
