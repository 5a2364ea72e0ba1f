"""The command line, told from the commands themselves."""

import re
from typing import Any

import typer

from armwright.cli import app

_SAID_DEFAULT = re.compile(r"\[default: (.*)\]$")  # of options whose default is found when the command runs
KINDS = {"str": "text", "int": "whole number", "float": "number", "Path": "path", "bool": ""}


def commands() -> dict[str, Any]:
    """Each command by its name, as Typer parses it."""
    return dict(typer.main.get_command(app).commands)  # type: ignore[attr-defined]


def page() -> str:
    """The reference of all commands, as Markdown."""
    told = commands()
    rows = [f"| [`{name}`](#{name}) | {_cell(_words(command))} |" for name, command in told.items()]
    head = [
        "# Command line",
        f"`armwright {{{', '.join(told)}}}`; `--help` after any of them says what stands here.",
        "What is refused ends with one line and exit code 2, what fails on the way with 1, Ctrl-C with 130.",
        "\n".join(["| command | |", "|---|---|", *rows]),
    ]
    return "\n\n".join([*head, *(_section(name, command) for name, command in told.items())]) + "\n"


def _section(name: str, command: Any) -> str:
    shown = [parameter for parameter in command.params if not parameter.hidden and parameter.name != "help"]
    arguments = [parameter for parameter in shown if parameter.param_type_name == "argument"]
    options = [parameter for parameter in shown if parameter.param_type_name == "option"]
    usage = " ".join(["armwright", name, *map(_metavar, arguments), *(["[OPTIONS]"] if options else [])])
    parts = [f"## {name}", _words(command), f"```\n{usage}\n```"]
    if arguments:
        rows = [f"| `{_metavar(a)}` | {_cell(a.help)} |" for a in arguments]
        parts.append("\n".join(["| argument | |", "|---|---|", *rows]))
    if options:
        rows = [f"| {_option(o)} | {_kind(o)} | {_default(o)} | {_cell(o.help)} |" for o in options]
        parts.append("\n".join(["| option | | default | |", "|---|---|---|---|", *rows]))
    return "\n\n".join(parts)


def _words(command: Any) -> str:
    return " ".join(command.help.split())


def _metavar(argument: Any) -> str:
    name = argument.metavar or argument.name.upper() + ("..." if argument.nargs == -1 else "")
    return name if argument.required else f"[{name}]"


def _option(option: Any) -> str:
    return " ".join(f"`{name}`" for name in (*option.opts, *option.secondary_opts))


def _kind(option: Any) -> str:
    if option.is_flag:
        return ""
    annotation = option.type_descriptor.annotation
    words = KINDS.get(getattr(annotation, "__name__", ""), "")
    if option.nargs > 1:
        words = f"{option.nargs} numbers"
    return f"{words}, may be repeated" if option.multiple else words


def _default(option: Any) -> str:
    if said := _SAID_DEFAULT.search(option.help or ""):
        return said[1]
    if option.is_flag:
        return f"`{option.opts[0]}`" if option.secondary_opts and option.default else ""
    if option.default in (None, ()) or option.multiple:
        return ""
    value = " ".join(map(str, option.default)) if isinstance(option.default, tuple) else str(option.default)
    return f"`{value}`"


def _cell(words: str | None) -> str:
    return " ".join(_SAID_DEFAULT.sub("", words or "").split()).replace("|", "\\|")
