"""Currents from the supply, by hand and by the balance of energy."""

from typing import Any

import numpy as np
import pytest

from armwright.kinematics.arms.actuation import FIXED_RATINGS, Actuation, actuation_at_joints, ratings_of
from armwright.kinematics.cycle.cycle_loads import CycleLoads, cycle_loads
from armwright.kinematics.cycle.instants import EQUAL, INSTANTS
from armwright.kinematics.cycle.supply_currents import supply_currents
from armwright.kinematics.cycle.torque_terms import torque_terms
from armwright.robot.actuators import catalogue, value_of
from armwright.robot.arm import Actuator
from tests.support.cycles import CURRENT, DRIVE, PEAK, VOLTAGE, Case, random_case, tolerated
from tests.support.reference_kinematics import Array


def drives_of(*actuators: Actuator, travel: float = 1.0) -> Actuation:
    """One arm with these actuators and a fixed joint."""
    ratings = np.array([[*map(ratings_of, actuators), FIXED_RATINGS]])
    travels = np.array([[*[travel] * len(actuators), 1.0]])
    return actuation_at_joints(ratings, travels, np.zeros(1), np.ones(1))


def constant(torques: Any, speeds: Any, holding: Any, time: float = 1.0, dwell: float = 0.0) -> CycleLoads:
    """One arm in one motion at constant torques and speeds, with a fixed joint as its last."""

    def along(values: Any) -> Array:
        return np.broadcast_to([*values, 0.0], (1, 1, INSTANTS, len(values) + 1))

    moving, weights = (along(torques), along(speeds)), np.array(EQUAL.weight)
    return CycleLoads(np.array([[time]]), np.array([dwell]), *moving, along(holding)[:, :, 0], weights)


@pytest.mark.parametrize("name", ["XM430-W350", "STS3215-12V", "AK60-6", "PH42-020-S300-R"])
def test_at_rest_at_the_peak_torque_a_drive_draws_its_current(name: str) -> None:
    record = catalogue()[name].completed()
    peak, current = value_of(record, "peak_torque"), value_of(record, "current")
    assert current is not None
    found = supply_currents(constant([peak], [0.0], [peak], dwell=2.0), drives_of(record.actuator()))
    assert found.peak[0] == pytest.approx(current)
    assert found.mean[0] == pytest.approx(current)


def test_dwells_count_by_their_time_with_the_holding_torque() -> None:
    found = supply_currents(constant([30.0], [2.0], [15.0], time=3.0, dwell=1.0), drives_of(DRIVE))
    moving, resting = 60.0 / VOLTAGE + CURRENT * 0.25, CURRENT * 0.0625
    assert found.peak[0] == pytest.approx(moving)
    assert found.mean[0] == pytest.approx((3.0 * moving + resting) / 4.0)
    heavy = supply_currents(constant([0.0], [0.0], [PEAK], dwell=1.0), drives_of(DRIVE))
    assert heavy.peak[0] == pytest.approx(CURRENT)


def loads(found: Case) -> tuple[CycleLoads, Actuation]:
    assert found.arrays.actuation is not None
    return cycle_loads(found.paths, torque_terms(found.paths, found.task.payloads.max())), found.arrays.actuation


@pytest.mark.parametrize(("dof", "kind"), [(4, "axis"), (5, "position"), (6, "orientation")])
def test_energy_is_balanced_over_a_closed_cycle(dof: int, kind: str) -> None:
    """What is drawn is what friction and windings lose, and what is braked: links and rotors return to their state."""
    found = random_case(dof, kind, seed=7, drive=DRIVE, time=1.5, dwell=0.3)
    of_cycle, drives = loads(found)
    closed = tolerated(found.paths)
    assert closed.any()

    def integral(power: Array) -> Array:
        """(N,) energies [J] of (N, M, F, D) powers; D joints together."""
        step = of_cycle.durations / (INSTANTS - 1)
        return (np.trapezoid(power, axis=2).sum(axis=-1) * step).sum(axis=1)

    torques, speeds = of_cycle.torques, of_cycle.speeds
    coulomb, viscous, peak = (each[:, None, None] for each in (drives.coulomb, drives.viscous, drives.peak))
    friction = integral(coulomb * np.abs(speeds) + viscous * speeds**2)
    braked = integral(np.maximum(-torques * speeds, 0.0))
    windings = integral(VOLTAGE * CURRENT * (torques / peak) ** 2)
    share = (of_cycle.holding / drives.peak[:, None]) ** 2
    windings += np.einsum("m,nmd->n", of_cycle.dwells, VOLTAGE * CURRENT * share)
    drawn = VOLTAGE * supply_currents(of_cycle, drives).mean * of_cycle.cycle_time
    assert drawn[closed] == pytest.approx((friction + braked + windings)[closed], rel=0.02)
