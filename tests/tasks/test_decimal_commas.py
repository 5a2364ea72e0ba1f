"""Decimal commas in the text of a task file."""

import pytest

from armwright.tasks.decimal_commas import find_decimal_commas


@pytest.mark.parametrize(
    ("text", "messages"),
    [
        ("- [0,4, 0.1]", ["line 1: [0,4, 0.1] is a list of 3 numbers; if 0,4 was meant as one, write 0.4"]),
        (
            "a: é\nb:\n  - {at: [-1, 2,05, 3]}",
            ["line 3: [-1, 2,05, 3] is a list of 4 numbers; if 2,05 was meant as one"],
        ),
        ("- [[0,1, 2], [3,4, 5]]", ["line 1: [0,1, 2]", "line 1: [3,4, 5]"]),
        ("- [0,4,0.1]\n- [0, 4, 0.1]\n- [0.5,4, 1]\n- [Y,P, R]\n- [1]\n- []", []),
        ("a: see [1,2, 3]\nb: '[1,2, 3]'\nc: 1  # [1,2, 3]\nd: ['1',2, 3]", []),
    ],
)
def test_mixed_commas_are_found(text: str, messages: list[str]) -> None:
    found = find_decimal_commas(text)
    assert len(found) == len(messages)
    for line, message in zip(found, messages, strict=True):
        assert line.startswith(message)
