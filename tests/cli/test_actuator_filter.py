"""Actuators chosen by bounds."""

import csv
import io
import json

import pytest

from armwright.robot.actuators import catalogue
from tests.support.command_line import armwright, refused


def chosen(*options: str) -> set[str]:
    return {record["name"] for record in json.loads(armwright("actuators", *options, "--json").stdout)}


def where(*conditions: str) -> list[str]:
    return [argument for condition in conditions for argument in ("--where", condition)]


def test_actuators_are_chosen_by_bounds() -> None:
    records = [record.completed() for record in catalogue().values()]
    expected = {
        r.name
        for r in records
        if (r.peak_torque or 0.0) >= 2.0 and r.price is not None and r.price <= 60.0 and r.voltage == 12.0
    }
    assert expected
    assert chosen(*where("peak_torque>=2 N m", "price<=60 USD", "voltage==12")) == expected
    shown = armwright("actuators", *where("peak_torque>=2", "price<=60", "voltage==12")).stdout
    assert {line.split()[0] for line in shown.splitlines()[1:] if "Feetech" in line} <= expected
    assert "left out, as their price is unknown" in shown


def test_bounds_may_be_in_other_units_and_of_named_actuators() -> None:
    assert chosen("XM430-W350", "MG996R", "--where", "peak_torque>2") == {"XM430-W350"}
    assert "none of 42 actuators has price < 1 USD" in refused(1, "actuators", "--where", "price<1")
    assert chosen("--where", "mass<=60 g") == chosen("--where", "mass<=0.06")
    assert chosen("--where", "speed>100 rpm") == {
        r.name for r in catalogue().values() if r.speed is not None and r.speed > 100 * 3.141592653589793 / 30
    }


def test_csv_and_json_hold_the_same_values() -> None:
    records = json.loads(armwright("actuators", "--json").stdout)
    rows = list(csv.DictReader(io.StringIO(armwright("actuators", "--csv").stdout)))
    assert [row["name"] for row in rows] == [record["name"] for record in records]
    for row, record in zip(rows, records, strict=True):
        assert float(row["mass"]) == record["mass"]
        assert row["assumed"].split() == record["assumed"]
        assert (float(row["price"]) if row["price"] else None) == record.get("price")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--where", "peak_torque>=2 V"), "peak_torque: expected a bound in N m, got 2 V"),
        (("--where", "mass<80 lbs"), "mass: expected a bound in kg or g, got 80 lbs"),
        (("--where", "price=cheap"), '--where "price=cheap": expected a name, one of <= < == > >= and a number'),
        (("--where", "torqe>2"), 'unknown value "torqe".'),
        (("--where", "backlsh<2"), 'Did you mean "backlash"?'),
        (("--where", "gear_ratio<2 m"), "gear_ratio: expected a number without a unit, got 2 m"),
        (("--json", "--csv"), "--json and --csv: expected one of them"),
    ],
)
def test_mistakes_are_one_line(options: tuple[str, ...], words: str) -> None:
    assert words in refused(2, "actuators", *options)
