"""One supply for the motors of a design, and their ratings at it."""

from itertools import product
from typing import Any

import numpy as np
import pytest

from armwright.exceptions import SpaceError
from armwright.robot.actuators import ActuatorRecord, catalogue, named_actuator
from armwright.spaces.arm_builder import stack_designs
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.supply_voltages import supply_voltages
from armwright.yaml_documents import check_document
from tests.support.arms import LIGHT

MOTORS = ("XL330-M288", "XL430-W250", "XM430-W350", "STS3250", "RobStride-00", "RobStride-05", "PH42-020-S300-R")
OWN = {"name": "own", "mass": 0.1, "stall_torque": 2.0, "speed": 5.0, "voltage": 12.0}


def space(actuators: Any, **keys: Any) -> DesignSpace:
    content = {"joints": 3, "joint_types": ["P"], "motor_bodies": False, **LIGHT, "actuators": list(actuators), **keys}
    return check_document(content, DesignSpace, SpaceError, "space.yaml")


def supply_of(*motors: Any, **keys: Any) -> list[float]:
    """The voltages of the joints of an arm with these motors."""
    names = [motor if isinstance(motor, str) else motor["name"] for motor in motors]
    own = space(list(dict.fromkeys(motors)) if isinstance(motors[0], str) else motors, joints=len(motors), **keys)
    design = own.sample(1, 0)[0]
    if len(set(names)) > 1:
        design = own.design(design.params | {f"motor_{j}": name for j, name in enumerate(names, start=1)})
    return [joint.actuator.voltage for joint in own.arm(design).joints if joint.actuator and joint.actuator.voltage]


@pytest.mark.parametrize("record", catalogue().values(), ids=lambda record: record.name)
def test_ratings_at_stated_voltages_are_the_makers(record: ActuatorRecord) -> None:
    own = (record.voltage, record.completed().peak_torque, record.speed)
    for volts, torque, speed in [own, *record.at_voltages]:
        motor = record.at_supply(volts).actuator()  # pyright: ignore[reportArgumentType]
        assert (motor.voltage, motor.peak_torque, motor.speed) == pytest.approx((volts, torque, speed))
        assert motor.continuous_torque == record.completed().rated_torque
        assert (motor.rotor_inertia, motor.mass) == (record.completed().rotor_inertia, record.mass)


def test_ratings_between_stated_voltages_are_interpolated() -> None:
    """XL430: 1.0 N m and 47 rev/min at 9 V, 1.4 N m and 57 rev/min at 11.1 V."""
    motor = named_actuator("XL430-W250").at_supply(10.05).actuator()
    assert motor.peak_torque == pytest.approx(1.2)
    assert motor.speed == pytest.approx(52.0 * np.pi / 30.0, rel=1e-3)


@pytest.mark.parametrize(("name", "stated"), [("XM430-W350", 2.7), ("XM540-W270", 5.5), ("XH540-W270", 5.9)])
def test_stall_current_at_a_higher_voltage_is_nearly_the_makers(name: str, stated: float) -> None:
    """ROBOTIS states it at 14.8 V, ours follows from that at 12 V by the copper loss."""
    assert named_actuator(name).at_supply(14.8).current == pytest.approx(stated, rel=0.08)


@pytest.mark.parametrize("kind", ["servo", "coreless servo", "geared drive", "quasi-direct-drive", "harmonic"])
def test_only_dc_servos_gain_torque_from_more_voltage(kind: Any) -> None:
    record = ActuatorRecord.model_validate({**OWN, "kind": kind})
    full, more = record.completed(), record.at_supply(13.2)
    assert more.speed == pytest.approx(1.1 * 5.0)
    is_servo = kind.endswith("servo")
    assert more.peak_torque == pytest.approx(2.2 if is_servo else 2.0)
    assert full.corner_speed is not None
    assert more.corner_speed == pytest.approx(0.0 if is_servo else full.corner_speed + 0.1 * 5.0)
    slopes = [(one.speed - one.corner_speed) / one.peak_torque for one in (full, more)]  # type: ignore[operator]
    assert slopes[0] == pytest.approx(slopes[1])


def test_supply_is_the_highest_that_all_makers_state() -> None:
    assert set(supply_of("XL430-W250", "XL430-W250")) == {12.0}
    assert set(supply_of("XM430-W350")) == {14.8}
    assert set(supply_of("XL430-W250", "XM430-W350", "STS3250")) == {12.0}
    assert set(supply_of("XM430-W350", "XM540-W270", supply=12)) == {12.0}


def test_assumed_range_is_used_only_if_motors_need_it() -> None:
    lower = {**OWN, "name": "lower", "voltage": 11.1}
    assert supply_of(OWN) == [12.0]
    assert supply_of(OWN, lower) == pytest.approx([11.1, 11.1])
    assert supply_of(OWN, {**lower, "voltage": 10.0}) == pytest.approx([10.8, 10.8])
    assert supply_of(OWN, {**lower, "voltage": 9.0}) == pytest.approx([12.0, 9.0])


def test_number_of_supplies_is_the_least_that_hits_all_ranges() -> None:
    own = space(MOTORS, joints=4)
    motors = np.array(list(product(range(len(MOTORS)), repeat=4)))
    volts = supply_voltages(own, motors, np.ones(motors.shape, dtype=bool))
    low, high = np.array([record.supply_range for record in own.actuators])[motors].transpose(2, 0, 1)
    assert np.all((low <= volts) & (volts <= high))
    for row in np.random.default_rng(0).choice(len(motors), 200, replace=False):
        ends = [set(np.flatnonzero((low[row] <= end) & (end <= high[row]))) for end in high[row]]
        least = next(
            n for n in range(1, 5) if any(set().union(*some) == set(range(4)) for some in product(ends, repeat=n))
        )
        assert len(np.unique(volts[row])) == least


def test_stacked_ratings_are_those_of_single_arms() -> None:
    own = space(MOTORS, joints=[2, 4], joint_types=["P", "S", "F"])
    designs = own.sample(200, 1)
    actuation = stack_designs(own, own.matrix(designs)).actuation
    assert actuation is not None
    for row, design in enumerate(designs):
        joints = own.arm(design).joints
        volts = [joint.actuator.voltage if joint.actuator else 0.0 for joint in joints]
        assert actuation.voltage[row, : len(joints)].tolist() == volts
        peaks = [joint.effort if joint.actuator else np.inf for joint in joints]
        assert actuation.peak[row, : len(joints)] == pytest.approx(peaks)


@pytest.mark.parametrize(
    ("actuators", "keys", "words"),
    [
        (["XM430-W350", "XL330-M288"], {"supply": 12}, "XL330-M288 takes 3.7 to 6 V, not the supply of 12 V; leave it"),
        ([OWN], {"supply": 13.5}, "own takes 10.8 to 13.2 V, not the supply of 13.5 V"),
        ([OWN | {"voltage_max": 11.0}], {}, "own states voltages outside its range of 10.8 to 11 V"),
        ([OWN | {"at_voltages": [[9.0, 0.0, 3.0]]}], {}, "at_voltages needs voltage, speed, and values above 0"),
        ([OWN], {"mass": None}, "expected links of a material, or a mass, got neither.*try link_section: {tubes"),
    ],
)
def test_unusable_supplies_and_links_are_refused(actuators: Any, keys: dict[str, Any], words: str) -> None:
    with pytest.raises(SpaceError, match=words):
        space(actuators, **keys)


def test_changed_assumed_values_keep_the_supply() -> None:
    own = space([OWN])
    changed = own.model_copy(update={"actuators": (own.actuators[0].scaled(["rotor_inertia"], 2.0),)})
    (before, after) = (one.arm(one.sample(1, 0)[0]).joints[0].actuator for one in (own, changed))
    assert before is not None
    assert after is not None
    assert (after.voltage, after.speed) == (before.voltage, before.speed) == (12.0, 5.0)
    assert after.rotor_inertia == pytest.approx(2.0 * (before.rotor_inertia or 0.0))
