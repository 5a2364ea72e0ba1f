"""What is installed only where it is asked for, such as with `pip install "armwright[live]"`."""

from collections.abc import Generator, Mapping
from contextlib import contextmanager
from importlib.util import find_spec

from armwright.exceptions import MissingExtraError

# The packages that an extra brings: as they are imported, and as they are installed.
EXTRAS: Mapping[str, Mapping[str, str]] = {
    "arms": {"robot_descriptions": "robot_descriptions", "xacrodoc": "xacrodoc"},
    "distributed": {"cryptography": "cryptography", "distributed": "distributed"},
    "gp": {"greenlet": "greenlet", "torch": "torch"},
    "live": {"starlette": "starlette", "uvicorn": "uvicorn"},
    "llm": {
        "anthropic": "anthropic",
        "google.genai": "google-genai",
        "openai": "openai",
        "pydantic_ai": "pydantic-ai-slim",
    },
}


def is_installed(package: str) -> bool:
    """Whether a package can be imported; it is not imported for that."""
    try:
        return find_spec(package) is not None
    except ModuleNotFoundError:  # what it lies in is not there
        return False


def missing_packages(extra: str) -> list[str]:
    """The packages of an extra that are not installed."""
    return [package for package in EXTRAS[extra] if not is_installed(package)]


def check_extra(extra: str, subject: str) -> None:
    """MissingExtraError where a package of the extra is not installed; `subject` needs them all."""
    missing = missing_packages(extra)
    if missing:
        raise _missing(extra, subject, missing)


@contextmanager
def requires_extra(extra: str, subject: str) -> Generator[None]:
    """Around imports of what `subject` needs; MissingExtraError where one fails."""
    try:
        yield
    except ModuleNotFoundError as fault:
        raise _missing(extra, subject, missing_packages(extra) or [str(fault.name)]) from fault
    except ImportError as fault:  # another version
        words = " ".join(str(fault).split())
        raise MissingExtraError(f"{subject} needs another {fault.name} ({words}): {install_command(extra)}") from fault


def install_command(extra: str) -> str:
    """What installs an extra."""
    return f'pip install "armwright[{extra}]"'


def _missing(extra: str, subject: str, packages: list[str]) -> MissingExtraError:
    *others, last = packages
    named = f"{', '.join(others)} and {last}" if others else last
    return MissingExtraError(f"{subject} needs {named}: {install_command(extra)}")
