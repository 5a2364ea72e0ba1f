"""Reading answers: lenient about form, strict about values."""

import json
import random
import time
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from armwright.arrays import LARGEST_OBJECTIVE
from armwright.exceptions import DesignError
from armwright.llm.answer import Answer, answer_schema, read_answers, read_text, written_answers
from armwright.llm.model_options import PromptOptions
from armwright.problem.problem import Problem
from armwright.spaces.design_space import paper_space
from armwright.tasks.catalogue import load_task
from tests.support.chat_server import GOOD_DESIGN

PROBLEM = Problem(load_task("target-1"))
DESIGN = PROBLEM.space.design({name: value for name, value in GOOD_DESIGN.items() if name != "reason"})
OTHER = PROBLEM.space.clipped((0.5, 0.25, -1.0), "PPYR", (0.05, 0.1, 0.15, 0.3))
THIRD = PROBLEM.space.clipped((-0.5, 0.0, 0.125), "RYYP", (0.25, 0.1, 0.2, 0.3))
JSON = json.dumps(GOOD_DESIGN)
LINES = "ORIGIN: (0, 0.01, -0.1)\nJOINTS: (Y, P, R, P)\nLINKS: (0.2, 0.2, 0.2, 0.2)\n"
OTHER_LINES = "ORIGIN: (0.5, 0.25, -1)\nJOINTS: (P, P, Y, R)\nLINKS: (0.05, 0.1, 0.15, 0.3)\n"
THIRD_LINES = "ORIGIN: (-0.5, 0, 0.125)\nJOINTS: (R, Y, Y, P)\nLINKS: (0.25, 0.1, 0.2, 0.3)\n"


def changed(**values: Any) -> dict[str, Any]:
    return {**GOOD_DESIGN, **values}


def one(text: str) -> Answer:
    (answer,) = read_text(text, PROBLEM)
    return answer


finite = st.floats(-LARGEST_OBJECTIVE, LARGEST_OBJECTIVE)
reasons = st.text(max_size=400)


@given(
    joints=st.integers(1, 8),
    n=st.integers(1, 4),
    seed=st.integers(0, 2**31),
    reason=reasons,
    expected=st.one_of(st.none(), st.tuples(finite, finite)),
    thoughts=st.text(max_size=50),
)
def test_written_answers_are_read_back(
    joints: int, n: int, seed: int, reason: str, expected: tuple[float, float] | None, thoughts: str
) -> None:
    problem = Problem(load_task("target-2"), paper_space(joints))
    answers = [Answer(design, reason, expected) for design in problem.space.sample(n, seed)]
    once = read_answers(json.loads(written_answers(answers, problem, thoughts)), problem, n)
    assert [answer.design for answer in once] == [answer.design for answer in answers]
    assert [answer.expected for answer in once] == [expected] * n
    assert all(len(answer.reason) <= 300 and answer.reason == " ".join(answer.reason.split()) for answer in once)
    assert read_text(written_answers(once, problem, thoughts), problem, n) == once
    assert read_text(f"My answer:\n```json\n{written_answers(once, problem)}\n```\n", problem, n)[0].design


@given(joints=st.integers(1, 8), proposals=st.integers(1, 3), expected=st.booleans(), reasoning=st.booleans())
def test_schema_describes_accepted_answers(joints: int, proposals: int, expected: bool, reasoning: bool) -> None:
    problem = Problem(load_task("target-2"), paper_space(joints))
    told = (1.0, 2.0) if expected else None
    answers = [Answer(design, "so", told) for design in problem.space.sample(proposals, 1)]
    content = json.loads(written_answers(answers, problem, "thoughts" if reasoning else ""))
    answer, memory = "one-step" if reasoning else "two-step", "own" if expected else "none"
    schema = answer_schema(problem, PromptOptions(answer=answer, memory=memory, proposals=proposals))
    assert list(content) == schema["required"] == list(schema["properties"])
    fields = schema["properties"]["designs"]["items"] if proposals > 1 else schema
    for design in content["designs"] if proposals > 1 else [content]:
        assert list(design) == fields["required"] == list(fields["properties"])
        for name, field in fields["properties"].items():
            assert isinstance(design[name], {"number": float, "string": str}[field["type"]])
            assert design[name] in field.get("enum", [design[name]])
    assert read_answers(content, problem, proposals) == answers


@pytest.mark.parametrize(
    "content",
    [
        changed(link_2="0.2", origin_z="-0.1"),
        changed(link_2="0.2 m", origin_z="−0.1m"),
        changed(link_2=" +.2 ", origin_z="-1e-1"),
        changed(origin_x=0),
        changed(joint_1="y", joint_2=" p ", joint_3="'R'", joint_4='"P"'),
        changed(joint_1="yaw", joint_2="Pitch", joint_3="ROLL"),
        {key.upper(): value for key, value in GOOD_DESIGN.items()},
        {"designs": [GOOD_DESIGN]},
        {"reasoning": "so it is", **GOOD_DESIGN},
        {"origin": [0, 0.01, -0.1], "joints": ["Y", "P", "R", "P"], "links": [0.2, 0.2, 0.2, "0.2 m"]},
        {"ORIGIN": "(0, 0.01, -0.1)", "JOINTS": "YPRP", "LINKS": "0.2, 0.2, 0.2, 0.2"},
        changed(reason=None),
        changed(reason=["a", "b"]),
        changed(expected_position_error="so so", expected_torque=None),
    ],
)
def test_equivalent_forms_are_read_alike(content: dict[str, Any]) -> None:
    assert read_answers(content, PROBLEM)[0].design == DESIGN
    assert one(json.dumps(content)).design == DESIGN


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ('"origin_x": NaN', "origin_x = nan is not a finite number [m]"),
        ('"origin_x": "nan"', "origin_x = nan is not a finite number [m]"),
        ('"origin_x": Infinity', "origin_x = inf is not a finite number [m]"),
        ('"origin_x": 1e999', "origin_x = inf is not a finite number [m]"),
        ('"origin_x": 1' + "0" * 400, "origin_x = inf is not a finite number [m]"),
        ('"origin_x": true', "origin_x = True is not a finite number [m]"),
        ('"origin_x": null', "origin_x = None is not a finite number [m]"),
        ('"origin_x": [[1]]', "origin_x = [[1]] is not a finite number [m]"),
        ('"origin_x": "0,1"', "origin_x = '0,1' is not a finite number [m]"),
        ('"origin_x": "0_1"', "origin_x = '0_1' is not a finite number [m]"),
        ('"origin_x": "1 cm"', "origin_x = '1 cm' is not a finite number [m]"),
        ('"origin_x": 0.1, "origin_x": 0.2', "origin_x = '0.1 and 0.2' is not a finite number [m]"),
        ('"link_3": 1.4', "link_3 = 1.4 m is outside 0.03 <= link_3 <= 0.3 m"),
        ('"link_3": "1.4 m"', "link_3 = 1.4 m is outside 0.03 <= link_3 <= 0.3 m"),
        ('"link_3": 0.30000000000000004', "link_3 = 0.30000000000000004 m is outside 0.03 <= link_3 <= 0.3 m"),
        ('"link_3": -0.2', "link_3 = -0.2 m is outside"),
        ('"joint_2": "Z"', "joint_2 = 'Z' is not one of R, P, Y"),
        ('"joint_2": "RP"', "joint_2 = 'RP' is not one of R, P, Y"),
        ('"joint_2": ["Y"]', "joint_2 = ['Y'] is not one of R, P, Y"),
        ('"joint_2": null', "joint_2 = None is not one of R, P, Y"),
        ('"link_5": 0.2', 'unknown parameter "link_5"'),
        ('"lnk_4": 0.2', 'Did you mean "link_4"?'),
        ('"link_4": "' + "9" * 5000 + '"', "link_4 = inf is not a finite number [m]"),
        ('"link_4": "' + "long " * 5000 + '"', "link_4 = 'long long"),
        ('"' + "k" * 50_000 + '": 1', 'unknown parameter "kkkk'),
        ('"two\\nlines\\u001b[31m": 1', 'unknown parameter "two lines"'),
    ],
)
def test_refusals_name_parameter_and_range(change: str, message: str) -> None:
    text = JSON[:-1] + ", " + change + "}"
    if change.split('"')[1] in GOOD_DESIGN and change.count(change.split('"')[1]) == 1:  # the value, not a second one
        rest = {key: value for key, value in GOOD_DESIGN.items() if key != change.split('"')[1]}
        text = json.dumps(rest)[:-1] + ", " + change + "}"
    elif "and" in message:
        text = text.replace('"origin_x": 0.0, ', "")
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
        ("[]", "no design found"),
        ("null", "no design found"),
        ("{" * 100_000, "no design found"),
        ('{"designs": []}', "designs: expected a list of objects"),
        ('{"designs": 7}', "designs: expected a list of objects"),
        ('{"designs": [7]}', "expected an object with one value per parameter"),
        (json.dumps({k: v for k, v in GOOD_DESIGN.items() if k != "link_4"}), "missing: link_4"),
        (LINES.replace("0.2)", "0.2, 0.2)"), 'unknown parameter "link_5"'),
        (LINES.replace("-0.1)", "-0.1, 3)"), 'unknown parameter "origin_4"'),
        (LINES.replace("(0, ", "("), "missing: origin_z"),
        (LINES.replace(", P)", ")"), "missing: joint_4"),
        (LINES.replace("(Y,", "(Z,"), "joint_1 = 'Z' is not one of R, P, Y"),
        (LINES.replace("(0.2,", "(20 cm,"), "link_1 = '20 cm' is not a finite number [m]"),
        (LINES.replace("(0.2,", "(2.5,"), "link_1 = 2.5 m is outside"),
        (LINES.replace("(0.2,", "(nan,"), "link_1 = nan is not a finite number [m]"),
        (LINES.replace("(0.2,", "(0.2 ± 0.1,"), "missing: link_1"),
        (LINES.replace("(0.2,", "(0.1-0.2,"), "missing: link_1"),
        (LINES.replace("(0.2,", "(1/5,"), "missing: link_1"),
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
        JSON.replace("}", ",}"),
        JSON.replace('"origin_y"', '// above the ground\n"origin_y"').replace(", //", ",  // metres\n//"),
        f'{JSON}\n{{"note": "that is all"}}',
        "\\frac{1}{2} " * 2000 + JSON,
        f'{{"reasoning": "</think> {{\\"origin_x\\": 1}} <think>", {JSON[1:]}',
        LINES,
        LINES.lower(),
        LINES.replace("(", "[").replace(")", "]"),
        LINES.replace("(", "").replace(")", ""),
        LINES.replace(": ", " = "),
        LINES.replace(":", ":\n"),
        LINES.replace("\n", "\r\n"),
        LINES.replace("ORIGIN:", "- **ORIGIN:**").replace("JOINTS:", "* **JOINTS**:").replace("LINKS:", "3. `LINKS`:"),
        LINES.replace("ORIGIN:", "### ORIGIN:").replace("JOINTS:", "> JOINTS:").replace("LINKS:", "• LINKS:"),
        LINES.replace(",", " m,").replace(" m, P", ", P").replace(" m, R", ", R").replace("2)", "2 m)"),
        LINES.replace("Y, P, R, P", "YPRP"),
        LINES.replace("(Y, P, R, P)", "Y-P-R-P"),
        LINES.replace("(Y, P, R, P)", "Y P R P"),
        LINES.replace("(Y, P, R, P)", "y, p, r, p"),
        LINES.replace("(Y, P, R, P)", "Yaw, pitch, Roll, pitch"),
        LINES.replace("(Y, P, R, P)", "(Y (yaw), P (pitch), R (roll), P (pitch))"),
        LINES.replace("(Y, P, R, P)", "joint_1 = Y, joint_2 = P, joint_3 = R, joint_4 = P"),
        LINES.replace("-0.1", "−0.1"),
        LINES.replace("-0.1", "-.1").replace("0.01", "1e-2"),
        LINES.replace("(0, 0.01, -0.1)", "$(0, 0.01, -0.1)\\,\\mathrm{m}$"),
        LINES.replace("(0, 0.01, -0.1)", "\\(0 \\, ; 0.01 ; -0.1\\)"),
        LINES.replace("(0, 0.01, -0.1)", "(0, 0.01, -0.1) m, a little below the centre"),
        LINES.replace("(0, 0.01, -0.1)", "0, 0.01, -0.1 (a little below)"),
        LINES.replace("(0, 0.01, -0.1)", "(x = 0, y = 0.01, z = -0.1)"),
        LINES.replace("(0, 0.01, -0.1)", "(origin_x, origin_y, origin_z) = (0, 0.01, -0.1)"),
        LINES.replace("(0.2, 0.2, 0.2, 0.2)", "link_4 = 0.2 m, link_2 = 0.2 m, link_1 = 0.2 m, link_3 = 0.2 m"),
        LINES.replace("(0.2, 0.2, 0.2, 0.2)", "L1 = 0.2, L2 = 0.2, L3 = 0.2, L4 = 0.2"),
        LINES.replace("\n", "  "),
        f"ORIGIN: The targets lie about (0, 0, 0).\nJOINTS: Yaw first.\nLINKS: Long ones, 0.3 m at most.\n\n{LINES}",
        f"{LINES}\nREASON: It is good. LINKS = long, JOINTS = strong.",
    ],
)
def test_design_is_found_in_free_text(text: str) -> None:
    assert one(text).design == DESIGN


def test_reason_and_expectation_are_read_from_lines() -> None:
    answer = one(LINES + "EXPECTED: (1.25, 3.5)\nREASON: a shoulder\x1b[31m in   the centre" + " far" * 200)
    assert answer.expected == (1.25, 3.5)
    assert answer.reason.startswith("a shoulder in the centre far")
    assert len(answer.reason) <= 300
    for words in ("(1.25 m, 3.5)", "E_pos = 1.25, E_torque = 3.5", "1.25, 3.5", "**(1.25, 3.5)**"):
        assert one(f"{LINES}EXPECTED: {words}").expected == (1.25, 3.5)
    for words in ("less than before", "(1.25)", "(1.25, nan)", "(1, 2, 3)"):
        assert one(f"{LINES}EXPECTED: {words}").expected is None
    assert one(json.dumps(changed(expected=[1.25, 3.5]))).expected == (1.25, 3.5)
    assert one(json.dumps(changed(expected_position_error="1.25", expected_torque=3.5))).expected == (1.25, 3.5)


@pytest.mark.parametrize(
    "text",
    [
        LINES + OTHER_LINES + THIRD_LINES,
        "A draft:\n" + OTHER_LINES + LINES + OTHER_LINES + "REASON: light\n" + THIRD_LINES,
        json.dumps({"designs": [dict(d.params) for d in (DESIGN, OTHER, THIRD)]}),
        json.dumps([dict(d.params) for d in (DESIGN, OTHER, THIRD)]),
        "\n".join(f"```json\n{json.dumps(d.params)}\n```" for d in (THIRD, DESIGN, OTHER, THIRD)),
        json.dumps({"designs": [dict(d.params) for d in (DESIGN, OTHER, THIRD, THIRD)]}),
    ],
)
def test_several_designs_are_read(text: str) -> None:
    assert [answer.design for answer in read_text(text, PROBLEM, 3)] == [DESIGN, OTHER, THIRD]


def test_refused_design_among_several_is_named() -> None:
    for text in (
        LINES + OTHER_LINES.replace("0.05", "5"),
        json.dumps({"designs": [dict(DESIGN.params), {**OTHER.params, "link_1": 5}]}),
    ):
        with pytest.raises(DesignError, match=r"^design 2: link_1 = 5 m is outside"):
            read_text(text, PROBLEM, 2)


PIECES = (
    *'{}[]":,()\n \\',
    *("NaN", "null", "true", "1e999", "-", "−", "0.2", "<think>", "</think>", "```json", "ORIGIN:", "JOINTS:"),
    *("LINKS:", "EXPECTED:", "REASON:", '"origin_x"', '"designs"', "link_1", "link_", "(Y, P, R, P)"),
    *("\x00", "\ud800", "𝟛", "²"),
    *(LINES, JSON, OTHER_LINES, "//", "**", "  " * 9),
)  # fmt: skip


def garbled(chance: random.Random) -> str:
    """A string of pieces, or a good answer with some pieces in wrong places."""
    if chance.random() < 0.4:
        return "".join(chance.choices(PIECES, k=chance.randrange(40)))
    text = chance.choice((JSON, LINES, json.dumps({"designs": [GOOD_DESIGN] * 2}), LINES + JSON))
    for _ in range(chance.randrange(1, 5)):
        start = chance.randrange(len(text) + 1)
        text = text[:start] + chance.choice(PIECES) + text[start + chance.randrange(4) :]
    return text


def read_or_refuse(text: str, proposals: int) -> bool:
    refused = ""
    answers: list[Answer] = []
    try:
        answers = read_text(text, PROBLEM, proposals)
    except DesignError as refusal:
        refused = str(refusal)
    assert "\n" not in refused
    assert len(refused) < 1000
    if refused:
        return False
    assert 1 <= len(answers) <= proposals
    assert all(PROBLEM.space.design(answer.design.params) == answer.design for answer in answers)
    assert read_text(written_answers(answers, PROBLEM), PROBLEM, proposals) == answers
    return True


def test_garbled_answers_are_read_or_refused() -> None:
    chance = random.Random(0)
    outcomes = [read_or_refuse(garbled(chance), chance.choice((1, 3))) for _ in range(1500)]
    assert 0.05 < sum(outcomes) / len(outcomes) < 0.95


@given(text=st.text(), proposals=st.integers(1, 3))
def test_arbitrary_text_is_read_or_refused(text: str, proposals: int) -> None:
    read_or_refuse(text, proposals)


@pytest.mark.parametrize(
    "text",
    [
        "{" * 100_000,
        '{"a":' * 20_000,
        '{"origin_x":[' * 8_000,
        "[" * 100_000,
        '{"a": "' * 15_000,
        " \n" * 50_000,
        "*" * 100_000,
        "- " * 50_000 + "ORIGIN",
        "ORIGIN " * 15_000,
        "ORIGIN:" + " " * 100_000,
        "ORIGIN: (" * 11_000,
        "ORIGIN: (" + "link_" * 20_000,
        "ORIGIN: " + "1" * 100_000,
        "ORIGIN: " + "1 " * 50_000,
        ("LINKS: (" + "link_a, " * 240 + "\n") * 50,
        "<think>" * 15_000,
        "," * 100_000,
        "//" * 50_000,
        "\\a" * 50_000,
        "JOINTS: " + "Y(" * 50_000,
        '{"designs": [' + ", ".join([JSON] * 400) + "]}",
        '{"a": ' + "9" * 90_000 + "}",
    ],
    ids=range(22),
)
def test_long_answers_are_read_quickly(text: str) -> None:
    started = time.process_time()
    read_or_refuse(text, 1)
    read_or_refuse(LINES.replace("\n", "\n" + text[:3000] + "\n"), 3)
    assert time.process_time() - started < 20  # quadratic ones took minutes
