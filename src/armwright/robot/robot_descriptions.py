"""URDF files by path, or by the name of an arm in the package `robot_descriptions`, which downloads it."""

import re
from importlib import import_module
from pathlib import Path
from typing import Any

from armwright.exceptions import ArmError, FailureError, did_you_mean
from armwright.extras import naming_extras

ALIASES = {"so100": "soarm100", "so101": "soarm101"}
_SUFFIX = "_description"


def find_urdf(name_or_path: str | Path) -> Path:
    """Return the URDF file of a path, or of an arm by name, such as `ur5e` or `panda`.

    Raises:
        ArmError: If there is neither a file nor an arm of this name.
        MissingExtraError: If the extra `arms` is not installed.
        FailureError: If the description cannot be downloaded.
    """
    path = Path(name_or_path)
    if path.is_file():
        return path
    if path.is_dir():
        raise ArmError(f"{path} is a folder; expected a URDF file, or the name of an arm, such as ur5e")
    if path.suffix or len(path.parts) != 1:
        raise ArmError(f"there is no file {path}")
    return _download(str(name_or_path))


def _download(name: str) -> Path:
    with naming_extras(f"there is no file {name}, and an arm by its name", "arms"):
        robots: Any = import_module("robot_descriptions")
    known: dict[str, str] = {}
    for module, description in robots.DESCRIPTIONS.items():
        if description.has_urdf:
            known[_plain(module.removesuffix(_SUFFIX))] = module
    key = _plain(name)
    module = known.get(ALIASES.get(key, key))
    if module is None:
        names = [module.removesuffix(_SUFFIX) for module in known.values()]
        raise ArmError(
            f'there is no file {name}, and robot_descriptions has no URDF "{name}".{did_you_mean(name, names)}'
        )
    git: Any = import_module("git")  # comes with robot_descriptions
    try:
        description = import_module(f"robot_descriptions.{module}")  # which downloads what is missing
        path = import_module("robot_descriptions._xacro").get_urdf_path(description)
    except (ImportError, OSError, ValueError, RuntimeError, git.GitError) as fault:
        raise FailureError(
            f"robot_descriptions cannot give the URDF of {name}: {_reason(fault)}. The first download needs "
            "network access and git, for some arms also xacrodoc; a local URDF file needs none of them"
        ) from fault
    return Path(path)


def _reason(fault: Exception) -> str:
    """Return the reason on one line; of git, the part that it calls fatal."""
    text = " ".join(str(fault).split())
    return text[max(0, text.find("fatal:")) :][:200].strip("'. ")


def _plain(name: str) -> str:
    return re.sub("[^a-z0-9]", "", name.lower())
