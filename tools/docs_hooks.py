"""MkDocs hook that adds the reference of all commands, written by Typer, to the page reference/cli.md."""

from typing import Any

import typer
from typer.cli import get_docs_for_click

from armwright.cli.app import app


def on_page_markdown(markdown: str, *, page: Any, **_: Any) -> str:
    """Append one section per command to the command-line page."""
    if page.file.src_uri != "reference/cli.md":
        return markdown
    group: Any = typer.main.get_command(app)
    context = typer.Context(group, info_name="armwright")
    commands = [group.get_command(context, name) for name in group.list_commands(context)]
    sections = [get_docs_for_click(obj=one, ctx=context, indent=1, call_prefix="armwright") for one in commands]
    return "\n".join([markdown, *sections])
