"""Package metadata agrees everywhere."""

import re
import tomllib
from typing import Any

import pytest
import yaml

from tests import ROOT

PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CITATION: dict[str, Any] = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))


def test_version_and_licence_agree_everywhere() -> None:
    versions = re.findall(r"^## \[(.+?)\]", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert PROJECT["version"] == CITATION["version"] == versions[0]
    assert PROJECT["license"] == CITATION["license"] == "MIT"


def test_paper_is_cited_as_in_the_method() -> None:
    (paper,) = CITATION["references"]
    method = " ".join((ROOT / "docs" / "method.md").read_text(encoding="utf-8").replace("\n>", "\n").split())
    authors = ", ".join(f"{author['given-names'][0]}. {author['family-names']}" for author in paper["authors"])
    where = f"{paper['journal']} {paper['volume']}:{paper['start']}-{paper['end']}, {paper['year']}"
    assert f"{authors}: *{paper['title']}*, {where}, doi {paper['doi']}" in method


@pytest.mark.parametrize("document", ["CONTRIBUTING.md", "README.md"])
def test_linked_files_exist(document: str) -> None:
    links = re.findall(r"\]\((?!https?:|#)([^)#]+)", (ROOT / document).read_text(encoding="utf-8"))
    assert links
    assert not [link for link in links if not (ROOT / link).exists()]
