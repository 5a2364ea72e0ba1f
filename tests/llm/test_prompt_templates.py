"""Custom prompt templates."""

import re
from pathlib import Path

import pytest

from armwright.exceptions import SettingsError
from armwright.llm.prompt import MAX_TEMPLATE, Prompt, load_prompt
from armwright.tasks.catalogue import load_task
from tests.support.fixed_problem import FixedProblem, fixed_history

PAPER = FixedProblem(load_task("target-1"))


def test_template_can_extend_the_builtin_one() -> None:
    own = Prompt(
        "own",
        '{% extends "proposal.md.j2" %}\n{% block role %}You build arms.{% endblock %}\n'
        "{% block results %}{% for design in front %}{{ shown(design) }}{% endfor %}"
        "{% for i in range(2) %}{{ interval(space.link, 'link') }}{{ 0.1 | exact }}{% endfor %}{% endblock %}",
    )
    text = own.render(fixed_history(PAPER), 0)
    assert text.startswith("You build arms.")
    assert "Design 5\nORIGIN: (0.019, 0.022, 0.506)" in text
    assert "0.03 <= link <= 0.3" in text


@pytest.mark.parametrize(
    ("template", "text"),
    [
        ("{{ 'a-b'.replace('-', '+').upper().center(7, '*') }}{{ 'x'.ljust(3) ~ 1 }}.", "**A+B**x  1."),
        ("{{ '%.2f %s' | format(1 / 3, 'm') }} {{ '{:>4}|{:.1f}'.format(1, 2) }}", "0.33 m    1|2.0"),
        ("{{ ['b', 'a'] | sort | map('upper') | join(', ') }} {{ [1, 2] | sum + [3][0] }}", "A, B 6"),
        ("{% for a in [1, 2] %}{{ loop.cycle('odd', 'even') }}{{ loop.index }}{% endfor %}", "odd1even2"),
        ("{% set c = cycler(1, 2) %}{{ none | default(c.next(), true) }}{{ c.next() }}", "12"),
        ("{% set j = joiner(';') %}{{ j() }}a{{ j() }}b", "a;b"),
        ("{% for k, v in {'a': 1}.items() %}{{ k }}{{ v }}{% endfor %}{{ dict(b=2).get('b') }}", "a12"),
        ("{% set s = namespace(x=1) %}{% for i in range(3) %}{% set s.x = s.x * 2 %}{% endfor %}{{ s.x }}", "8"),
        ("{% for a in [[[1]]] recursive %}({{ loop(a) if a is iterable else a }}){% endfor %}", "(((1)))"),
        ("{% call(n) twice(2) %}{{ n }}{% endcall %}{% macro twice(n) %}{{ caller(2 * n) }}{% endmacro %}", None),
        ("{% macro m(n) %}{{ caller(n) }}{% endmacro %}{% call(n) m(2) %}{{ n }}!{% endcall %}", "2!"),
        ("{% filter upper %}x{% endfilter %}{{ '{:>{}}'.format(1, 3) }}", "X  1"),
        ("{{ '0123456789'[2:5] }}{{ [1, 2, 3][1:] | length }} {{ description[:9] | length }}", "2342 9"),
    ],
)
def test_common_template_features_are_allowed(template: str, text: str | None) -> None:
    if text is None:  # a macro that is not yet there
        with pytest.raises(SettingsError, match="'twice' is undefined"):
            Prompt("own", template).render(fixed_history(PAPER), 0)
    else:
        assert Prompt("own", template).render(fixed_history(PAPER), 0) == text + "\n"


def test_standalone_template_is_rendered() -> None:
    own = Prompt(
        "own", "{{ n_targets }} targets, {{ objectives | map(attribute='symbol') | join('+') }}: {{ targets[:9] }}"
    )
    assert own.render(fixed_history(PAPER), 0) == "8 targets, E_pos+E_torque: [(-0.450,\n"


@pytest.mark.parametrize(
    ("template", "message"),
    [
        ("{% for x in front %}", "line 1: Unexpected end of template"),
        ("\n\n{{ frnt }}", '"frnt", which does not exist. Did you mean "front"'),
        ("\n{{ front | frist }}", "line 2: No filter named 'frist'"),
        ("{{ front is frist }}", "No test named 'frist'"),
        ('{% extends "propsal.md.j2" %}', 'uses the template "propsal.md.j2", which does not exist. Did you mean'),
        ('{% include "/etc/passwd" %}', 'uses the template "/etc/passwd", which does not exist'),
        ("{{ " + "(" * 3000 + "1" + ")" * 3000 + " }}", "nested too deeply"),
        ("{{ lipsum() }}", '"lipsum", which does not exist'),
        ("{{ front | random }}", "No filter named 'random'"),
    ],
)
def test_unreadable_template_is_refused(tmp_path: Path, template: str, message: str) -> None:
    file = tmp_path / "own.md"
    file.write_text(template, encoding="utf-8")
    with pytest.raises(SettingsError, match=re.escape(message)) as refusal:
        load_prompt(file)
    assert "\n" not in str(refusal.value)
    assert str(refusal.value).startswith("prompt own.md")


@pytest.mark.parametrize(
    ("template", "message"),
    [
        ('a\n{{ "".__class__.__mro__ }}', "line 2 cannot be rendered: access to attribute '__class__'"),
        ("{{ space.__init__.__globals__ }}", "is unsafe"),
        ("{{ space.model_copy.__func__ }}", "is unsafe"),
        ('{{ "{0.__class__}".format(space) }}', "is unsafe"),
        ("{{ cycler.__init__ }}", "is unsafe"),
        ("{{ front.append(1) }}", "is unsafe"),
        ("{{ front[0].nmber }}", "has no attribute 'nmber'"),
        ("{{ 1 / 0 }}", "division by zero"),
        ("{{ range(10 ** 9) | length }}", "Range too big"),
        ("{{ n_targets * 1e999 }}", "name 'inf' is not defined"),
        ("{% macro m(n) %}{{ m(n) }}{{ m(n) }}{% endmacro %}{{ m(1) }}", "cannot be rendered: "),
        ('{{ "x" * 10 ** 7 }}', "it is longer than 1,000,000 characters"),
        ('{% for i in range(99999) %}{{ "x" * 1000 }}{% endfor %}', "it is longer than 1,000,000 characters"),
        (
            "{% for i in range(99999) %}{% for j in range(99999) %}words {% endfor %}{% endfor %}",
            "it is longer than 1,000,000 characters",
        ),
        ("{{ space.sample }}{{ space.nothing }}", "has no attribute 'nothing'"),
        ("{{ task.target_positions.tofile('x') }}", "tofile cannot be called in a template"),
        ("{{ (task.target_positions | attr('tofile'))('x') }}", "tofile cannot be called in a template"),
        ("{{ task.parse_raw('', proto='pickle', allow_pickle=true) }}", "parse_raw cannot be called"),
        ("{{ task.model_dump_json() }}", "model_dump_json cannot be called"),
        ("{{ space.link_mass(1) }}", "link_mass cannot be called"),
    ],
)
def test_unrenderable_template_is_refused(template: str, message: str) -> None:
    with pytest.raises(SettingsError, match=re.escape(message)) as refusal:
        Prompt("own.md", template).render(fixed_history(PAPER), 0)
    assert "\n" not in str(refusal.value)
    assert str(refusal.value).startswith("prompt own.md")


def test_file_that_is_not_a_template_is_refused(tmp_path: Path) -> None:
    (tmp_path / "latin").write_bytes(b"caf\xe9")
    (tmp_path / "large").write_bytes(b"x" * (MAX_TEMPLATE + 1))
    (tmp_path / "plus").write_text("my own", encoding="utf-8")
    for name, message in (
        ("latin", "is not a text file in UTF-8"),
        ("large", "expected at most 256 KiB"),
        (".", "is a folder, not a template file"),
        ("none", 'unknown prompt ".*none"'),
    ):
        with pytest.raises(SettingsError, match=message):
            load_prompt(tmp_path / name)
    assert load_prompt(tmp_path / "plus").name == "./plus"  # else a resumed run would take it for ours
