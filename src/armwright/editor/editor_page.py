"""The HTML of the editor's page."""

from importlib import resources

from armwright.report.page_assembly import SHARED, PageSource, assemble, token_tag

EDITOR = PageSource(
    template="editor.html",
    main="editor.js",
    styles=("page.css", "editor.css"),
    libraries=("three.min.js",),
    folders=(resources.files("armwright.editor") / "page", SHARED),
)


def render_editor(name: str, token: str) -> str:
    """Return the page for a task file of this name."""
    return assemble(EDITOR, f"{name}: armwright", connects=True, values={"token": token_tag(token)})
