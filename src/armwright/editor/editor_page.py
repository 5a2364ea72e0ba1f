"""The HTML of the editor's page."""

from importlib import resources

from armwright.page.assembly import SHARED, PageSource, assemble

EDITOR = PageSource(
    template="editor.html",
    main="editor.js",
    styles=("page.css", "editor.css"),
    libraries=("three.min.js",),
    folders=(resources.files("armwright.editor") / "page", SHARED),
)


def editor_shell() -> str:
    """Return the page, which fetches its data."""
    return assemble(EDITOR, "armwright", connects=True, values={})
