"""What MkDocs calls: the README as the first page, references from the code, links to files of the repository."""

import sys
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files, InclusionLevel

sys.path.insert(0, str(Path(__file__).parents[1]))  # MkDocs loads this file by its path, outside of its package

from website import links, reference


def on_files(files: Files, *, config: MkDocsConfig) -> Files:
    """Adds the pages that are made."""
    made = {page: (links.ROOT / file).read_text(encoding="utf-8") for file, page in links.PAGES.items()}
    for page, text in made.items():
        files.append(File.generated(config, page, content=text))
    for page, make in reference.pages().items():
        files.append(File.generated(config, page, content=make()))
    texts = {file.src_uri: file.content_string for file in files.documentation_pages()}
    shown = set[str]().union(*(links.sources(text, page) for page, text in texts.items()))
    for file in sorted(shown):
        page = File.generated(config, f"source/{file}.md", content=links.source_page(file))
        page.inclusion = InclusionLevel.NOT_IN_NAV
        files.append(page)
    return files


def on_page_markdown(markdown: str, *, page: Any, **_: Any) -> str:
    """Links of the repository as links of the guide."""
    return links.rewritten(markdown, page.file.src_uri)
