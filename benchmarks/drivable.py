"""How many designs that are called feasible can be driven: the fronts of twelve tasks with cycles, in MuJoCo.

The six built-in tasks with cycles and six of examples/, each searched with one seed; then every design of the front is
driven by armwright and by check_simulation.py, which knows armwright's files only. `motors` is the least distance of a
motor from anything but its neighbours by Coal, along the exported trajectories. `without bodies` is how many designs of
the front of a search that ignores motor bodies are feasible with them.

    python benchmarks/drivable.py [--evaluations 20000] [TASK ...]      # some 30 minutes on two cores
"""

import argparse
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import check_simulation
import mujoco
import numpy as np
from motor_clearance import motor_clearance

import armwright as aw
from armwright.arrays import Array
from armwright.proof.cycle_export import MODEL
from armwright.proof.recommendation import recommend
from armwright.proof.simulated_run import SimulatedMember, Simulator
from armwright.proof.simulation import PASS
from armwright.proof.verification import front_survival

BUILT_IN = ("desk-sorting", "box-palletising", "lathe-tending", "screwing", "casting-inspection", "dispensing")
EXAMPLES = ("2-assembly", "3-long-shelf", "4-wall-painting", "5-obstacle-reach", "6-price", "7-compare-arms")
PLACE = Path(__file__).parent.parent / "examples"
FLOOR = 0.1  # of the torque limit, below which claimed peaks are compared with it
JUMP = 1.5  # times the largest speed nearby, by which joints change from row to row


@dataclass(frozen=True)
class Result:
    """What was found for a task: reasons of failures, and (K,) |simulated / claimed - 1| of all joints' peaks.

    Attributes:
        motors: The least distance of a motor [m]; infinite without motors.
        without_bodies: Designs of a front that ignores motor bodies, and how many of them are feasible with them.
    """

    task: str
    designs: int
    verified: int
    agreed: int
    jumps: int
    recommended: tuple[str, ...]
    deviations: Array
    reasons: Counter[str]
    motors: float
    without_bodies: tuple[int, int]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--evaluations", type=int, default=20_000)
    parser.add_argument("tasks", nargs="*", default=[*BUILT_IN, *EXAMPLES])
    chosen = parser.parse_args()
    print(
        f"{'task':18s} designs verified agreed jumps recommended  peak torque off: median, worst, motors [mm], "
        "without bodies"
    )
    results: list[Result] = []
    with ProcessPoolExecutor(2) as pool:
        for result in pool.map(measure, chosen.tasks, [chosen.evaluations] * len(chosen.tasks)):
            results.append(result)
            show(result)
    everything = np.concatenate([result.deviations for result in results])
    designs, verified, agreed = (
        sum(getattr(one, name) for one in results) for name in ("designs", "verified", "agreed")
    )
    print(f"{verified} of {designs} verified ({verified / designs:.1%}), {agreed} verdicts agree; peak torque off by")
    print(f"{np.median(everything):.2%} (median), {everything.max():.1%} (worst)")


def show(result: Result) -> None:
    verdicts = Counter(status.split(":")[0] for status in result.recommended)
    shown = ", ".join(f"{count} {status}" for status, count in verdicts.items())
    off = result.deviations if len(result.deviations) else np.zeros(1)
    print(
        f"{result.task:18s} {result.designs:7d} {result.verified:8d} {result.agreed:6d} {result.jumps:5d} {shown:12s} "
        f"{np.median(off):6.2%} {off.max():6.1%} {1e3 * result.motors:8.2f}   {result.without_bodies[1]} of "
        f"{result.without_bodies[0]}",
        flush=True,
    )
    for reason, count in result.reasons.most_common():
        print(f"    {count} x {reason}")


def measure(name: str, evaluations: int) -> Result:
    """Search the front of a task and drive all its designs."""
    searched = problem(name)
    history = aw.find_front(searched, evaluations=evaluations, seed=0).history
    simulator = Simulator(history)
    members = [simulator(member.number) for member in history.front]
    with TemporaryDirectory() as folder:
        agreed = sum((not independent(member, Path(folder))) == (member.result.verdict == PASS) for member in members)
    failures = [member.result.reasons[0] for member in members if member.result.verdict != PASS]
    return Result(
        task=name,
        designs=len(members),
        verified=len(members) - len(failures),
        agreed=agreed,
        jumps=sum(jumps(member) for member in members),
        recommended=tuple(one.status for one in recommend(history, front_survival(history, None), simulator)),
        deviations=np.concatenate([deviations(member) for member in members]) if members else np.empty(0),
        reasons=Counter(failures),
        motors=min(
            (
                motor_clearance(history.member(member.result.design).arm, member.trajectory.q, searched.task.obstacles)
                for member in members
            ),
            default=np.inf,
        ),
        without_bodies=without_bodies(searched, evaluations) if searched.space.has_motor_bodies else (0, 0),
    )


def without_bodies(searched: aw.Problem, evaluations: int) -> tuple[int, int]:
    """Return how many designs a search that ignores motor bodies finds, and how many are feasible with them."""
    space = searched.space.model_validate(searched.space.model_dump() | {"motor_bodies": False})
    found = aw.find_front(aw.Problem(searched.task, space), evaluations=evaluations, seed=0).history.front
    outcomes = searched.evaluate([searched.space.design(member.design.params) for member in found])
    return len(found), int((outcomes.violations <= 0.0).all(axis=1).sum())


def problem(name: str) -> aw.Problem:
    """Return a built-in task with its own space, or an example."""
    if name in BUILT_IN:
        return aw.Problem(aw.load_task(name), aw.load_space(name))
    files = sorted(PLACE.glob(f"{name}*.yaml"))
    space = next(file for file in files if file.stem.endswith("-space"))
    (task,) = (file for file in files if file != space)
    return aw.Problem(aw.load_task(task), aw.load_space(space))


def independent(member: SimulatedMember, folder: Path) -> list[str]:
    """Return why a design fails by the check that knows its files only."""
    for name, content in member.files.items():
        (folder / name).write_text(content, encoding="utf-8")
    return check_simulation.check(folder)


def jumps(member: SimulatedMember) -> bool:
    """Return whether a joint moves further from one row to the next than its speed allows."""
    path = member.trajectory
    moved, speed = np.abs(np.diff(path.q, axis=0)), np.abs(path.qd)
    allowed = JUMP * np.maximum(speed[:-1], speed[1:]) * np.diff(path.time)[:, None] + 1e-4
    return bool((moved > allowed).any())


def deviations(member: SimulatedMember) -> Array:
    """Return (D,) by how much simulated and claimed peaks differ, relative to the claim or a tenth of the limit."""
    peaks = np.array([(joint.peak_torque, joint.claimed_peak_torque) for joint in member.result.joints])
    model: Any = mujoco.MjModel.from_xml_string(member.files[MODEL])  # pyright: ignore
    limit = np.where(model.jnt_actfrclimited.astype(bool), model.jnt_actfrcrange[:, 1], 0.0)
    return np.abs(peaks[:, 0] - peaks[:, 1]) / np.maximum(peaks[:, 1], FLOOR * limit)


if __name__ == "__main__":
    main()
