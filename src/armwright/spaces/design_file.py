"""Design files: initial designs of a search, from an existing arm or another run."""

from pathlib import Path
from typing import Any, cast

from pydantic import BaseModel

from armwright.exceptions import DesignError
from armwright.files import read_text
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.parameters import Design
from armwright.yaml_documents import MAX_BYTES, check_document, load_document


class DesignFile(BaseModel, frozen=True):
    """What is read of a design in the format of designs/NNNN/design.json."""

    params: dict[str, float | str]  # a value for each parameter of the space, by its name


def read_design(path: str | Path, space: DesignSpace) -> Design:
    """Read a design from a YAML or JSON file.

    Raises:
        DesignError: If it is not in the space.
    """
    content = load_document(read_text(Path(path), MAX_BYTES, DesignError), DesignError, str(path))
    if not isinstance(content, dict) or "params" not in content:
        raise DesignError(f"{path}: expected params, with a value for each parameter: {{params: {{link_1: 0.2, ...}}}}")
    params = cast("dict[str, Any]", content)["params"]
    checked = check_document({"params": params}, DesignFile, DesignError, str(path))
    try:
        return space.design(checked.params)
    except DesignError as error:
        raise DesignError(f"{path}: {error}") from error
