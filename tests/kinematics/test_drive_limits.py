"""What drives can deliver, and the least time of a motion, against brute force and TOPP-RA."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import toppra
from toppra import algorithm, constraint

from armwright.arrays import Array
from armwright.kinematics.arms.actuation import Actuation, actuation_at_joints, ratings_of
from armwright.kinematics.arms.arm_arrays import ArmArrays, stack_arms
from armwright.kinematics.cycle.drive_limits import (
    DRIVES,
    MotionLoad,
    available_torque,
    drive_torques,
    least_time,
    torque_speed_utilisation,
)
from armwright.robot.actuators import ActuatorRecord, catalogue
from armwright.spaces.design_space import DesignSpace
from tests.support.dynamics import inverse_dynamics

N, S, D = 400, 9, 3
TIMES = np.geomspace(1e-2, 1e3, 3001)  # [s]


def drives(n: int, d: int, rng: np.random.Generator) -> Actuation:
    """Random drives: servos with a corner speed of 0, drives with one, and some without a falling line."""
    no_load = rng.uniform(0.5, 10.0, (n, d))
    corner = no_load * rng.choice([0.0, 0.3, 0.9, 1.0], (n, d))
    columns = (rng.uniform(0.5, 5.0, (n, d)), np.ones((n, d)), corner, no_load, rng.uniform(0.0, 0.2, (n, d)))
    friction = (rng.uniform(0.0, 0.4, (n, d)), rng.uniform(0.0, 0.3, (n, d)) * rng.choice([1, 20], (n, d)))
    gear = np.random.default_rng(d + 9).choice([0.0, 0.3], (n, d))
    ratings = np.stack([*columns, *friction, gear, gear, *np.ones((9, n, d))], axis=-1)
    return actuation_at_joints(ratings, np.ones((n, d)), np.zeros(n), rng.uniform(1.0, 2.0, n))


def loads(motors: Actuation, rng: np.random.Generator, samples: int = S) -> MotionLoad:
    """Random samples, which no mechanism need have: torques and velocities of any sign, each of any size."""
    shape = (len(motors.peak), samples, motors.peak.shape[1])
    gravity, inertial, velocity, acceleration = rng.normal(size=(4, *shape)) * 10.0 ** rng.uniform(-2, 0.2, (4, *shape))
    velocity[:, 0] = 0.0
    return MotionLoad(gravity, inertial, velocity, acceleration)


def are_within(torque: Array, speed: Array, motors: Actuation, slack: float = 0.0) -> Array:
    """(N, K, D) whether required torques and speeds are within the limits, by the definition of the issue."""
    peak, corner, no_load = (each[:, None] for each in (motors.peak, motors.corner_speed, motors.no_load_speed))
    with np.errstate(divide="ignore", invalid="ignore"):
        line = np.where(
            np.abs(speed) <= corner * (1.0 + slack), peak, peak * (no_load - np.abs(speed)) / (no_load - corner)
        )
    limit = np.where(torque * speed > 0.0, np.minimum(peak, line), peak)
    required = motors.safety_factor[:, None, None] * np.abs(torque)
    return (required <= limit + slack * peak) & (np.abs(speed) <= no_load * (1.0 + slack))


def can_follow(load: MotionLoad, motors: Actuation, time: Array, slack: float = 0.0) -> Array:
    """(N,) whether that holds at every sample."""
    return are_within(*drive_torques(load, motors, time), motors, slack).all(axis=(1, 2))


def random_motions(seed: int, samples: int = S, joints: int = D) -> tuple[MotionLoad, Actuation]:
    rng = np.random.default_rng(seed)
    motors = drives(N, joints, rng)
    return loads(motors, rng, samples), motors


@pytest.mark.parametrize(("samples", "joints"), [(5, D), (3, 2), (2, 1)])
def test_least_time_is_the_least_of_all_times(samples: int, joints: int) -> None:
    load, motors = random_motions(samples, samples, joints)
    time = least_time((load, motors))
    holds = (motors.safety_factor[:, None, None] * np.abs(load.gravity) <= motors.peak[:, None]).all(axis=(1, 2))
    assert 0.1 < np.isfinite(time).mean() < 0.95
    assert np.isinf(time[~holds]).all()
    finite = np.where(np.isfinite(time), time, 1.0)
    assert can_follow(load, motors, finite, slack=1e-9)[np.isfinite(time)].all()
    possible = np.array([can_follow(load, motors, np.full(N, each)) & holds for each in TIMES])
    assert not (possible & (TIMES[:, None] < time * (1.0 - 1e-9))).any()
    begins = (np.diff(possible.astype(int), axis=0) == 1).sum(axis=0)
    assert joints > 2 or begins.max() > 1  # some of few joints are possible again after a gap between times


def test_lifting_takes_the_friction_of_the_gear_and_lowering_gets_none_of_it() -> None:
    """2 N m of gravity, up, down and at rest, with a share of 25 % of which a limit of 2.4 N m allows the last two."""
    velocity = np.array([1.0, -1.0, 0.0]).reshape(3, 1, 1)
    still, gravity = np.zeros((3, 1, 1)), np.full((3, 1, 1), 2.0)
    ratings = np.stack([np.full((3, 1), each) for each in (2.4, 1.0, 0.0, 9.0, *[0.0] * 3, 0.4, 0.25, *[1.0] * 9)], -1)
    motors = actuation_at_joints(ratings, np.ones((3, 1)), np.zeros(3), np.ones(3))
    load = MotionLoad(gravity, still, velocity, still)
    torques, speeds = drive_torques(load, motors, np.full(3, 10.0))
    assert (torques.ravel().tolist(), speeds.ravel().tolist()) == ([2.5, 2.0, 2.0], [0.1, -0.1, 0.0])
    use = torque_speed_utilisation(torques, speeds, motors).ravel()
    assert use.tolist() == [2.5 / 2.4 + 0.1 / 9.0, 2.0 / 2.4, 2.0 / 2.4]
    assert np.isfinite(least_time((load, motors))).tolist() == [False, True, True]
    at_output = replace(motors, limit_friction=np.zeros((3, 1)))
    assert np.isfinite(least_time((load, at_output))).all()


def test_torques_in_motion_are_those_of_rotors_and_friction_and_the_largest_nearby() -> None:
    load, motors = random_motions(4, samples=13)
    time = np.random.default_rng(1).uniform(0.2, 3.0, N)
    torques, speeds = drive_torques(load, motors, time)
    t, (coulomb, viscous, rotor, gear) = time[:, None, None], (
        getattr(motors, name)[:, None] for name in ("coulomb", "viscous", "rotor_inertia", "limit_friction")
    )  # fmt: skip
    speed = load.velocity / t
    before = load.gravity + coulomb * np.sign(speed) + viscous * speed
    before += (load.inertial + rotor * load.acceleration) / t**2
    assert speeds == pytest.approx(speed, rel=1e-12)
    expected = before * np.where(before * speed > 0.0, 1.0 + gear, 1.0)
    assert torques == pytest.approx(expected, rel=1e-12, abs=1e-9 * np.abs(expected).max())
    for values, few in zip((torques, speeds), drive_torques(load, motors, time, density=4), strict=True):
        assert np.array_equal(few[:, [0, -1]], values[:, [0, -1]])
        for kept, around in ((few[:, 1], values[:, 0:9]), (few[:, 2], values[:, 4:13])):
            assert np.array_equal(np.abs(kept), np.abs(around).max(axis=1))


def test_least_time_of_several_cases_is_the_least_that_all_of_them_allow() -> None:
    load, motors = random_motions(8)
    weak = motors.at_makers_limits.at_voltage(0.9)
    heavier = replace(load, gravity=1.1 * load.gravity, inertial=0.8 * load.inertial)
    cases = ((load, motors), (load, weak), (heavier, motors.at_makers_limits))
    time = least_time(*cases)
    finite = np.isfinite(time)
    assert 0.1 < finite.mean() < 0.95
    assert (time >= np.max([least_time(case) for case in cases], axis=0) * (1.0 - 1e-9)).all()
    for case in cases:
        assert can_follow(*case, np.where(finite, time, 1.0), slack=1e-9)[finite].all()
    holds = np.all([np.isfinite(least_time(case)) for case in cases], axis=0)
    possible = np.array([np.all([can_follow(*case, np.full(N, t)) for case in cases], axis=0) & holds for t in TIMES])
    assert not (possible & (TIMES[:, None] < time * (1.0 - 1e-9))).any()


def test_available_torque_is_the_largest_within_the_limits() -> None:
    rng = np.random.default_rng(6)
    motors = drives(N, D, rng).at_makers_limits
    torque, velocity = rng.normal(size=(2, N, S, D))
    velocity = velocity * motors.no_load_speed[:, None] / np.abs(velocity).max()
    most = np.sign(torque) * available_torque(torque, velocity, motors)
    assert are_within(0.999 * most, velocity, motors).all()
    assert not are_within(1.001 * most, velocity, motors).any()


@pytest.mark.parametrize("record", [r for r in catalogue().values() if r.speed is not None], ids=lambda r: r.name)
def test_torque_at_less_voltage_is_that_at_a_higher_speed(record: ActuatorRecord) -> None:
    """Less voltage acts like a higher back-EMF, whatever the kind of motor."""
    ratings = np.array([[ratings_of(record.actuator())]])
    full = actuation_at_joints(ratings, np.ones((1, 1)), np.zeros(1), np.ones(1))
    less, no_load = full.at_voltage(0.9), float(full.no_load_speed[0, 0])
    speed = np.linspace(0.0, 0.9 * no_load, 50)[None, :, None]
    push = np.ones_like(speed)
    higher = available_torque(push, speed + 0.1 * no_load, full)
    assert available_torque(push, speed + 1e-12, less) == pytest.approx(higher, rel=1e-9)
    assert (less.continuous, less.rotor_inertia) == (full.continuous, full.rotor_inertia)


def test_fixed_joints_do_not_limit_a_motion() -> None:
    load, motors = random_motions(17)
    names = ("peak", "continuous", "corner_speed", "no_load_speed")
    of_joints = (*names, *DRIVES[4:])
    fixed = replace(motors, **{name: np.where(np.arange(D) == 1, np.inf, getattr(motors, name)) for name in names})
    still = MotionLoad(*(np.where(np.arange(D) == 1, 0.0, each) for each in vars(load).values()))
    without = replace(motors, **{name: getattr(motors, name)[:, [0, 2]] for name in of_joints})
    two = MotionLoad(*(each[:, :, [0, 2]] for each in vars(load).values()))
    assert np.array_equal(least_time((still, fixed)), least_time((two, without)))
    rest = MotionLoad(*(np.zeros_like(each) for each in vars(load).values()))
    assert not least_time((rest, fixed)).any()


@pytest.mark.parametrize(
    "name", ["peak", "corner_speed", "no_load_speed", "coulomb", "viscous", "rotor_inertia", "limit_friction"]
)
def test_unknown_ratings_give_no_number(name: str) -> None:
    rng = np.random.default_rng(0)
    motors = drives(3, D, rng)
    unknown = replace(motors, **{name: np.where(np.arange(D) == 1, np.nan, getattr(motors, name))})
    assert np.isnan(least_time((loads(unknown, rng), unknown))).all()
    if "speed" in name:
        moving = np.ones((3, S, D))
        assert np.isnan(torque_speed_utilisation(moving, moving, unknown)[..., 1]).all()


def test_utilisation_is_at_most_1_within_the_limits() -> None:
    rng = np.random.default_rng(5)
    motors = drives(N, D, rng)
    torque, velocity = rng.normal(size=(2, N, S, D)) * [[[[2.0]]], [[[4.0]]]]
    use = torque_speed_utilisation(torque, velocity, motors)
    motoring = torque * velocity > 0.0  # the utilisation of a motor that brakes is that of its torque
    assert np.array_equal((use <= 1.0)[motoring], are_within(torque, velocity, motors)[motoring])
    required = motors.safety_factor[:, None, None] * np.abs(torque)
    for still in (torque_speed_utilisation(torque, np.zeros_like(velocity), motors), np.where(motoring, np.nan, use)):
        known = ~np.isnan(still)
        assert np.array_equal(still[known], (required / motors.peak[:, None])[known])


def quintic(n: int) -> tuple[Array, Array, Array]:
    """Fraction of the way, its rate and its change at n moments of a motion of one second."""
    t = np.linspace(0.0, 1.0, n)
    return (
        t**3 * (10.0 - 15.0 * t + 6.0 * t**2),
        30.0 * t**2 * (1.0 - t) ** 2,
        60.0 * t * (1.0 - t) * (1.0 - 2.0 * t),
    )


def with_constant_limits(arms: ArmArrays) -> Actuation:
    """The peak torque up to the no-load speed, and no friction but Coulomb's, the only one that TOPP-RA knows."""
    drives = arms.actuation
    assert drives is not None
    nothing = np.zeros_like(drives.viscous)
    return replace(drives, corner_speed=drives.no_load_speed, viscous=nothing, limit_friction=nothing)


def fastest_by_toppra(arms: ArmArrays, motors: Actuation, start: Array, end: Array) -> float:
    """Time-optimal parametrisation of a straight line in joint space (Pham and Pham 2018)."""

    def inverse(q: Array, velocity: Array, acceleration: Array) -> Array:
        state = (each[None, None] for each in (q, velocity, acceleration))
        return inverse_dynamics(arms, *state, np.zeros(1))[0, 0] + motors.rotor_inertia[0] * acceleration

    limit, speed = motors.peak[0] / motors.safety_factor[0], motors.no_load_speed[0]
    path = toppra.SplineInterpolator([0.0, 1.0], np.stack([start, end]))
    limits: list[Any] = [
        constraint.JointVelocityConstraint(np.stack([-speed, speed], axis=1)),
        constraint.JointTorqueConstraint(inverse, np.stack([-limit, limit], axis=1), motors.coulomb[0]),
    ]
    solver = algorithm.TOPPRA(limits, path, gridpoints=np.linspace(0.0, 1.0, 101), solver_wrapper="seidel")
    trajectory = solver.compute_trajectory(0, 0)
    assert trajectory is not None
    return float(trajectory.duration)


def test_time_optimal_motion_is_a_lower_bound() -> None:
    """With constant limits, no profile of time is faster than TOPP-RA's along the same path; the quintic is not far."""
    space = DesignSpace.model_validate(
        {"joints": 3, "joint_types": ["P", "Y"], "mass": {"kind": "per_metre", "kg": 0.5}, "link": [0.05, 0.15],
         "actuators": [catalogue()["XM430-W350"].model_dump(), catalogue()["XM540-W270"].model_dump()]}
    )  # fmt: skip
    rng = np.random.default_rng(3)
    share, rate, change = quintic(201)
    ratios: list[float] = []
    for design in space.sample(4, 4):
        arms = stack_arms([space.arm(design)])
        motors = with_constant_limits(arms)
        start, end = rng.uniform(-2.0, 2.0, (2, 3))
        line = end - start
        q, velocity, acceleration = (start + share[:, None] * line)[None], rate[:, None] * line, change[:, None] * line
        none = np.zeros(len(share))
        gravity = inverse_dynamics(arms, q, np.zeros_like(q), np.zeros_like(q), none)
        inertial = inverse_dynamics(arms, q, velocity[None], acceleration[None], none, gravity=False)
        load = MotionLoad(gravity, inertial, velocity[None], acceleration[None])
        (time,) = least_time((load, motors))
        bound = fastest_by_toppra(arms, motors, start, end)
        ratios.append(time / bound)
    assert min(ratios) >= 1.0
    assert max(ratios) <= 2.0  # 1.88 if only the speed limits both, 1.2 if only the acceleration does
