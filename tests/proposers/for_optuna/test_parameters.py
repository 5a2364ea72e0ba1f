"""Parameters of any study in answers: round trips and refusals."""

import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from optuna.distributions import BaseDistribution, CategoricalDistribution, FloatDistribution, IntDistribution

from armwright.exceptions import DesignError
from armwright.llm.model_options import PromptOptions
from armwright.proposers.for_optuna.answer import answer_schema, read_answer, written_answer
from armwright.proposers.for_optuna.parameter_values import (
    checked_value,
    choice_texts,
    json_value,
    read_value,
)
from armwright.proposers.for_optuna.parameters import Parameter, checked_params, study_parameters, unique_keys

CHOICES = st.one_of(st.none(), st.booleans(), st.integers(-9, 9), st.floats(-9, 9), st.text(max_size=6))


@st.composite
def ints(draw: st.DrawFn) -> tuple[IntDistribution, int]:
    low, steps = draw(st.integers(-1000, 1000)), draw(st.integers(0, 50))
    if draw(st.booleans()):
        low = abs(low) + 1
        return IntDistribution(low, low + steps, log=True), low + draw(st.integers(0, steps))
    step = draw(st.integers(1, 7))
    return IntDistribution(low, low + steps * step, step=step), low + step * draw(st.integers(0, steps))


@st.composite
def floats(draw: st.DrawFn) -> tuple[FloatDistribution, float]:
    low, width = draw(st.floats(-1e3, 1e3)), draw(st.floats(0, 1e3))
    if draw(st.booleans()):
        low = abs(low) + 1e-6
        return FloatDistribution(low, low + width, log=True), draw(st.floats(low, low + width))
    if draw(st.booleans()):
        return FloatDistribution(low, low + width), draw(st.floats(low, low + width))
    step, steps = draw(st.sampled_from([0.1, 0.25, 3.0, 1e-3])), draw(st.integers(0, 50))
    distribution = FloatDistribution(low, low + step * steps, step=step)
    return distribution, min(low + step * draw(st.integers(0, steps)), distribution.high)


@st.composite
def categories(draw: st.DrawFn) -> tuple[CategoricalDistribution, Any]:
    choices = draw(st.lists(CHOICES, min_size=1, max_size=6, unique_by=lambda choice: (type(choice), choice)))
    return CategoricalDistribution(choices), draw(st.sampled_from(choices))


@pytest.mark.filterwarnings("ignore:The distribution is specified by:UserWarning")
@given(st.dictionaries(st.text(max_size=70), st.one_of(ints(), floats(), categories()), min_size=1, max_size=5))
def test_written_answers_round_trip_and_fit_optuna(
    drawn: dict[str, tuple[BaseDistribution, Any]],
) -> None:
    space = {name: distribution for name, (distribution, _) in drawn.items()}
    params = {name: value for name, (_, value) in drawn.items()}
    parameters = study_parameters(space, [])
    back, reason = read_answer(json.loads(written_answer(params, "so", parameters)), parameters)
    assert (back, reason) == (params, "so")
    assert [type(back[name]) for name in params] == [type(value) for value in params.values()]
    assert checked_params(back, space, space) == params
    for name, value in back.items():
        assert space[name]._contains(space[name].to_internal_repr(value))


@given(st.one_of(ints(), categories()))
def test_schema_allows_written_answers(drawn: tuple[BaseDistribution, Any]) -> None:
    distribution, value = drawn
    (parameter,) = study_parameters({"x": distribution}, [])
    schema = answer_schema([parameter], PromptOptions(answer="one-step"))
    assert list(schema["properties"]) == ["reasoning", "parameters", "reason"]
    field = schema["properties"]["parameters"]["properties"]["x"]
    written = json_value(value, distribution)
    if isinstance(distribution, CategoricalDistribution):
        assert field["type"] == "string"
        assert written in field["enum"]
        assert len(field["enum"]) == len(distribution.choices)
    else:
        assert field["type"] == "integer"
        assert type(written) is int


@given(st.lists(st.text(max_size=70), unique=True, max_size=8))
def test_parameter_keys_are_unique_and_valid_for_vendors(names: list[str]) -> None:
    found = unique_keys(names)
    assert len(set(found)) == len(names)
    assert all(key.isascii() and 1 <= len(key) <= 64 and not set(key) & set(" /[](){}") for key in found)


def test_plain_name_is_its_own_key() -> None:
    assert unique_keys(["lr", "layer/units", "layer_units", "学习率"]) == ["lr", "layer_units_2", "layer_units", "___"]


@pytest.mark.parametrize(
    ("distribution", "written", "value"),
    [
        (IntDistribution(1, 9), "3", 3),
        (IntDistribution(16, 64, step=16), " 48 ", 48),
        (FloatDistribution(1e-5, 1.0, log=True), "1e-3", 1e-3),
        (FloatDistribution(0.0, 1.0, step=0.1), 0.3, 0.3),
        (FloatDistribution(0.0, 1.0, step=0.1), 0.70000001, 0.7000000000000001),
        (CategoricalDistribution(["rbf", "poly"]), "RBF", "rbf"),
        (CategoricalDistribution([True, False]), "True", True),
        (CategoricalDistribution([None, 5, 10]), None, None),
        (CategoricalDistribution([None, 5, 10]), "null", None),
        (CategoricalDistribution([None, 5, 10]), "10.0", 10),
        (CategoricalDistribution(["1", 1]), "1", 1),
        (CategoricalDistribution(["1", 1]), "'1'", "1"),
    ],
)
def test_values_are_read_in_the_intended_type(distribution: BaseDistribution, written: Any, value: Any) -> None:
    found = read_value("x", written, distribution)
    assert found == value
    assert type(found) is type(value)


@pytest.mark.parametrize(
    ("distribution", "written", "words"),
    [
        (IntDistribution(1, 9), 10, "x = 10 is outside 1 <= x <= 9"),
        (IntDistribution(1, 9), True, "x = True is not a whole number"),
        (IntDistribution(1, 9), 10**400, "a number beyond 64 bits"),
        (IntDistribution(16, 64, step=16), 40, "x = 40 is between the steps of 16 <= x <= 64 in steps of 16"),
        (FloatDistribution(1e-5, 1.0, log=True), 0.0, "x = 0 is outside 1e-05 <= x <= 1"),
        (FloatDistribution(0.0, 1.0), float("nan"), "x = nan is not a finite number"),
        (FloatDistribution(0.0, 1.0), [0.5], "not a finite number"),
        (CategoricalDistribution(["rbf", "poly"]), "rfb", "x = 'rfb' is not one of rbf, poly. Did you mean \"rbf\""),
        (CategoricalDistribution([1, 2]), True, "x = True is not one of 1, 2"),
        (CategoricalDistribution(["a", "b"]), {"a": 1}, "is not one of a, b"),
    ],
)
def test_values_outside_a_distribution_are_refused_with_the_reason(
    distribution: BaseDistribution, written: Any, words: str
) -> None:
    with pytest.raises(DesignError) as refusal:
        read_value("x", written, distribution)
    assert words in str(refusal.value)


def test_nan_choice_is_recognised() -> None:
    assert math.isnan(checked_value("x", float("nan"), CategoricalDistribution([1.0, float("nan")])))


def test_choices_with_equal_text_are_distinguished() -> None:
    assert choice_texts(CategoricalDistribution(["a", None, 0.5])) == ["a", "null", "0.5"]
    assert choice_texts(CategoricalDistribution(["1", 1])) == ["'1'", "1"]
    assert choice_texts(CategoricalDistribution(["", "a"])) == ["''", "'a'"]


PARAMETERS = [
    Parameter("kernel", "kernel", CategoricalDistribution(["rbf", "linear"])),
    Parameter("C", "C", FloatDistribution(1e-2, 1e2, log=True)),
    Parameter("gamma", "gamma", FloatDistribution(1e-4, 1.0, log=True), conditional=True),
]


def test_conditional_parameters_may_be_left_out() -> None:
    for left_out in ({}, {"gamma": None}, {"gamma": "n/a"}):
        params, _ = read_answer({"parameters": {"kernel": "linear", "C": 1, **left_out}}, PARAMETERS)
        assert params == {"kernel": "linear", "C": 1.0}
    schema = answer_schema(PARAMETERS, PromptOptions())
    assert schema["properties"]["parameters"]["required"] == ["kernel", "C"]


def test_answer_without_parameters_object_or_reason_is_read() -> None:
    """A missing reason is not the word None, and invisible characters are dropped."""
    for reason, read in ((None, ""), ("so\x1b[2J\u200b it\n is", "so it is")):
        answer = read_answer({"KERNEL": "rbf", "c": "2.5", "reason": reason}, PARAMETERS)
        assert answer == ({"kernel": "rbf", "C": 2.5}, read)


def test_parameter_may_be_named_reason() -> None:
    parameters = [Parameter("reason", "reason", IntDistribution(0, 9))]
    written = written_answer({"reason": 4}, "four", parameters)
    assert read_answer(json.loads(written), parameters) == ({"reason": 4}, "four")


def test_all_errors_are_reported_at_once() -> None:
    with pytest.raises(DesignError) as refusal:
        read_answer({"parameters": {"C": 1e3, "kernl": "rbf", "gamma": "big"}}, PARAMETERS)
    words = str(refusal.value)
    assert 'unknown parameter "kernl". Did you mean "kernel"?' in words
    assert "kernel is missing: one of rbf, linear" in words
    assert "C = 1000 is outside 0.01 <= C <= 100" in words
    assert "gamma = 'big' is not a finite number" in words
