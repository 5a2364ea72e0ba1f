"""Reading answers: lenient about form, strict about values."""

import json
import random
import time
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from armwright import Problem, PromptOptions, load_task, paper_space
from armwright.exceptions import DesignError
from armwright.llm.answer import Answer, answer_schema, read_answer, read_text, written_answer
from tests.support.chat_server import GOOD_DESIGN

PROBLEM = Problem(load_task("target-1"))
DESIGN = PROBLEM.space.design({name: value for name, value in GOOD_DESIGN.items() if name != "reason"})
OTHER = PROBLEM.space.clipped((0.5, 0.25, -1.0), "PPYR", (0.05, 0.1, 0.15, 0.3))
JSON = json.dumps(GOOD_DESIGN)
LINES = "ORIGIN: (0, 0.01, -0.1)\nJOINTS: (Y, P, R, P)\nLINKS: (0.2, 0.2, 0.2, 0.2)\n"
OTHER_LINES = "ORIGIN: (0.5, 0.25, -1)\nJOINTS: (P, P, Y, R)\nLINKS: (0.05, 0.1, 0.15, 0.3)\n"


def changed(**values: Any) -> dict[str, Any]:
    return {**GOOD_DESIGN, **values}


def one(text: str) -> Answer:
    return read_text(text, PROBLEM)


@given(
    joints=st.integers(1, 8), seed=st.integers(0, 2**31), reason=st.text(max_size=400), thoughts=st.text(max_size=50)
)
def test_written_answers_are_read_back(joints: int, seed: int, reason: str, thoughts: str) -> None:
    problem = Problem(load_task("target-2"), paper_space(joints))
    (design,) = problem.space.sample(1, seed)
    once = read_answer(json.loads(written_answer(Answer(design, reason), thoughts)), problem)
    assert once.design == design
    assert len(once.reason) <= 300
    assert once.reason == " ".join(once.reason.split())
    assert read_text(written_answer(once, thoughts), problem) == once
    assert read_text(f"My answer:\n```json\n{written_answer(once)}\n```\n", problem).design == design


@given(joints=st.integers(1, 8), reasoning=st.booleans())
def test_schema_describes_accepted_answers(joints: int, reasoning: bool) -> None:
    problem = Problem(load_task("target-2"), paper_space(joints))
    answer = Answer(problem.space.sample(1, 1)[0], "so")
    content = json.loads(written_answer(answer, "thoughts" if reasoning else ""))
    schema = answer_schema(problem, PromptOptions(answer="one-step" if reasoning else "two-step"))
    assert list(content) == schema["required"] == list(schema["properties"])
    for name, field in schema["properties"].items():
        assert isinstance(content[name], {"number": float, "string": str}[field["type"]])
        assert content[name] in field.get("enum", [content[name]])
    assert read_answer(content, problem) == answer


@pytest.mark.parametrize(
    "content",
    [
        changed(link_2="0.2", origin_z="-0.1"),
        changed(link_2="0.2 m", origin_z="−0.1m"),
        changed(origin_x=0),
        changed(joint_1="y", joint_2=" p ", joint_3="'R'", joint_4='"P"'),
        changed(joint_1="yaw", joint_2="Pitch", joint_3="ROLL"),
        {key.upper(): value for key, value in GOOD_DESIGN.items()},
        {"reasoning": "so it is", **GOOD_DESIGN},
        {"origin": [0, 0.01, -0.1], "joints": ["Y", "P", "R", "P"], "links": [0.2, 0.2, 0.2, "0.2 m"]},
        {"ORIGIN": "(0, 0.01, -0.1)", "JOINTS": "YPRP", "LINKS": "0.2, 0.2, 0.2, 0.2"},
        changed(reason=None),
    ],
)
def test_equivalent_forms_are_read_alike(content: dict[str, Any]) -> None:
    assert read_answer(content, PROBLEM).design == DESIGN
    assert one(json.dumps(content)).design == DESIGN


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ('"origin_x": NaN', "origin_x = nan is not a finite number [m]"),
        ('"origin_x": 1e999', "origin_x = inf is not a finite number [m]"),
        ('"origin_x": 1' + "0" * 400, "origin_x = inf is not a finite number [m]"),
        ('"origin_x": true', "origin_x = True is not a finite number [m]"),
        ('"origin_x": null', "origin_x = None is not a finite number [m]"),
        ('"origin_x": [[1]]', "origin_x = [[1]] is not a finite number [m]"),
        ('"origin_x": "0,1"', "origin_x = '0,1' is not a finite number [m]"),
        ('"origin_x": "0_1"', "origin_x = '0_1' is not a finite number [m]"),
        ('"origin_x": 0.1, "origin_x": 0.2', "origin_x = '0.1 and 0.2' is not a finite number [m]"),
        ('"link_3": 1.4', "link_3 = 1.4 m is outside 0.03 <= link_3 <= 0.3 m"),
        ('"link_3": 0.30000000000000004', "link_3 = 0.30000000000000004 m is outside 0.03 <= link_3 <= 0.3 m"),
        ('"joint_2": "Z"', "joint_2 = 'Z' is not one of R, P, Y"),
        ('"joint_2": ["Y"]', "joint_2 = ['Y'] is not one of R, P, Y"),
        ('"link_5": 0.2', 'unknown parameter "link_5"'),
        ('"lnk_4": 0.2', 'Did you mean "link_4"?'),
        ('"link_4": "' + "long " * 5000 + '"', "link_4 = 'long long"),
        ('"' + "k" * 50_000 + '": 1', 'unknown parameter "kkkk'),
        ('"two\\nlines\\u001b[31m": 1', 'unknown parameter "two lines"'),
    ],
)
def test_refusals_name_parameter_and_range(change: str, message: str) -> None:
    rest = {key: value for key, value in GOOD_DESIGN.items() if key != change.split('"')[1]}
    text = f"{json.dumps(rest)[:-1]}, {change}}}"
    for form in (text, f"So:\n```json\n{text}\n```\nThat is all."):
        with pytest.raises(DesignError) as refusal:
            one(form)
        assert message in str(refusal.value)
        assert "\n" not in str(refusal.value)
        assert len(str(refusal.value)) < 400


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no design found"),
        ("I cannot help with that.", "no design found"),
        ("{}", "missing: origin_x, origin_y"),
        ("{" * 100_000, "no design found"),
        (json.dumps({k: v for k, v in GOOD_DESIGN.items() if k != "link_4"}), "missing: link_4"),
        (LINES.replace("0.2)", "0.2, 0.2)"), 'unknown parameter "link_5"'),
        (LINES.replace("-0.1)", "-0.1, 3)"), 'unknown parameter "origin_4"'),
        (LINES.replace("(0, ", "("), "missing: origin_z"),
        (LINES.replace(", P)", ")"), "missing: joint_4"),
        (LINES.replace("(Y,", "(Z,"), "joint_1 = 'Z' is not one of R, P, Y"),
        (LINES.replace("(0.2,", "(20 cm,"), "link_1 = '20 cm' is not a finite number [m]"),
        (LINES.replace("(0.2,", "(0.2 ± 0.1,"), "link_1 = '0.2 ± 0.1' is not a finite number [m]"),
        (LINES.replace("-0.1)", "-0.1) m, a little below the centre"), 'unknown parameter "origin_4"'),
        (LINES + "LINKS: (0.1, 0.2, 0.2, 0.2)", "link_1 = '0.2 and 0.1' is not"),
        (LINES + "ORIGIN: (0, 0, 0)", "missing: joint_1"),  # begun, not finished: never filled up from the one before
        (LINES + '{"origin_x": 0.3, "origin_y"', "the last JSON object is incomplete"),
        (JSON + '\nBetter: {"origin_x": 0.3,', "the last JSON object is incomplete"),
        (f"<think>{JSON}</think> I do not know.", "no design found"),
        (f"<think>{JSON}", "no design found"),
        (f"{JSON}</think> I do not know.", "no design found"),
    ],
)
def test_ambiguous_answers_are_refused(text: str, message: str) -> None:
    with pytest.raises(DesignError) as refusal:
        one(text)
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    "text",
    [
        JSON,
        f"```json\n{JSON}\n```",
        f"```\n{json.dumps(GOOD_DESIGN, indent=4)}\n```\nI hope it works.",
        f"First {json.dumps(OTHER.params)}, no: {JSON}",
        f"<think>{json.dumps(OTHER.params)} or</think>{JSON}",
        f"<thinking>{OTHER_LINES}</thinking>\n{LINES}",
        f"{OTHER_LINES}\n</think>\n{LINES}",
        f"{OTHER_LINES} ... {JSON}",
        f"{json.dumps(OTHER.params)} ... \n{LINES}",
        f'{JSON}\n{{"note": "that is all"}}',
        "\\frac{1}{2} " * 2000 + JSON,
        f'{{"reasoning": "</think> {{\\"origin_x\\": 1}} <think>", {JSON[1:]}',
        LINES,
        LINES.lower(),
        LINES.replace(": ", " = "),
        LINES.replace("ORIGIN:", "- **ORIGIN:**").replace("JOINTS:", "* **JOINTS**:").replace("LINKS:", "3. `LINKS`:"),
        LINES.replace(",", " m,").replace(" m, P", ", P").replace(" m, R", ", R").replace("2)", "2 m)"),
        LINES.replace("Y, P, R, P", "YPRP"),
        LINES.replace("(Y, P, R, P)", "Y P R P"),
        LINES.replace("(Y, P, R, P)", "Yaw, pitch, Roll, pitch"),
        f"ORIGIN: The targets lie about (0, 0, 0).\nJOINTS: Yaw first.\nLINKS: Long ones, 0.3 m at most.\n\n{LINES}",
        f"{LINES}\nREASON: It is good. LINKS = long, JOINTS = strong.",
    ],
)
def test_design_is_found_in_free_text(text: str) -> None:
    assert one(text).design == DESIGN


def test_reason_is_read_from_its_line() -> None:
    answer = one(LINES + "REASON: a shoulder\x1b[31m in   the centre" + " far" * 200)
    assert answer.reason.startswith("a shoulder in the centre far")
    assert len(answer.reason) <= 300


PIECES = (
    *'{}[]":,()\n \\',
    *("NaN", "null", "true", "1e999", "-", "−", "0.2", "<think>", "</think>", "```json", "ORIGIN:", "JOINTS:"),
    *("LINKS:", "REASON:", '"origin_x"', "link_1", "link_", "(Y, P, R, P)"),
    *("\x00", "\ud800", "𝟛", "²"),
    *(LINES, JSON, OTHER_LINES, "//", "**", "  " * 9),
)  # fmt: skip


def garbled(chance: random.Random) -> str:
    """A string of pieces, or a good answer with some pieces in wrong places."""
    if chance.random() < 0.4:
        return "".join(chance.choices(PIECES, k=chance.randrange(40)))
    text = chance.choice((JSON, LINES, LINES + JSON))
    for _ in range(chance.randrange(1, 5)):
        start = chance.randrange(len(text) + 1)
        text = text[:start] + chance.choice(PIECES) + text[start + chance.randrange(4) :]
    return text


def read_or_refuse(text: str) -> bool:
    refused, answer = "", None
    try:
        answer = one(text)
    except DesignError as refusal:
        refused = str(refusal)
    assert "\n" not in refused
    assert len(refused) < 1000
    if answer is None:
        return False
    assert PROBLEM.space.design(answer.design.params) == answer.design
    assert one(written_answer(answer)) == answer
    return True


def test_garbled_answers_are_read_or_refused() -> None:
    chance = random.Random(0)
    outcomes = [read_or_refuse(garbled(chance)) for _ in range(1500)]
    assert 0.05 < sum(outcomes) / len(outcomes) < 0.95


@given(text=st.text())
def test_arbitrary_text_is_read_or_refused(text: str) -> None:
    read_or_refuse(text)


@pytest.mark.parametrize(
    "text",
    [
        "{" * 100_000,
        '{"a":' * 20_000,
        " \n" * 50_000,
        "- " * 50_000 + "ORIGIN",
        "ORIGIN: (" * 11_000,
        "ORIGIN: (" + "link_" * 20_000,
        ("LINKS: (" + "link_a, " * 240 + "\n") * 50,
        "<think>" * 15_000,
        "//" * 50_000,
        "JOINTS: " + "Y(" * 50_000,
        JSON * 400,
        '{"a": ' + "9" * 90_000 + "}",
    ],
    ids=range(12),
)
def test_long_answers_are_read_quickly(text: str) -> None:
    started = time.process_time()
    read_or_refuse(text)
    read_or_refuse(LINES.replace("\n", "\n" + text[:3000] + "\n"))
    assert time.process_time() - started < 20  # quadratic ones took minutes
