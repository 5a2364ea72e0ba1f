"""Design files: initial designs of a search, from an existing arm or another run."""

from pathlib import Path

from pydantic import BaseModel

from armwright.exceptions import DesignError
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.parameters import Design
from armwright.yaml_documents import read_document


class DesignFile(BaseModel, frozen=True, extra="allow"):
    """What counts of a file in the format of designs/NNNN/design.json, which also holds what a run found."""

    params: dict[str, float | str]  # a value for each parameter of the space, by its name


def read_design(path: str | Path, space: DesignSpace) -> Design:
    """Read a design from a YAML or JSON file; DesignError if it is not in the space."""
    content = read_document(Path(path), DesignFile, DesignError)
    try:
        return space.design(content.params)
    except DesignError as error:
        raise DesignError(f"{path}: {error}") from error
