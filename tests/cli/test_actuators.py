"""The catalogue of actuators as text, CSV and JSON."""

import csv
import io
import json

from tests.support.command_line import armwright, refused


def test_csv_and_json_hold_the_same_values() -> None:
    records = json.loads(armwright("actuators", "--json").stdout)
    rows = list(csv.DictReader(io.StringIO(armwright("actuators", "--csv").stdout)))
    assert [row["name"] for row in rows] == [record["name"] for record in records]
    for row, record in zip(rows, records, strict=True):
        assert float(row["mass"]) == record["mass"]
        assert row["assumed"].split() == record["assumed"]
        assert (float(row["price"]) if row["price"] else None) == record.get("price")


def test_unknown_actuators_and_two_formats_are_one_line() -> None:
    assert 'Did you mean "XM430-W350"?' in refused(2, "actuators", "XM430-W351")
    assert "--json and --csv: expected one of them" in refused(2, "actuators", "--json", "--csv")
