"""Optional dependencies (extras), such as `pip install "armwright[edit]"`.

A module may import a package of an extra like any other: the command or the public name that needs the module names
the extra (`naming_extras`).
"""

from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from importlib.util import find_spec

from armwright.exceptions import MissingExtraError

# Packages of each extra, by import name
EXTRAS: Mapping[str, Sequence[str]] = {
    "arms": ("robot_descriptions", "xacrodoc"),
    "distributed": ("cryptography", "distributed"),
    "edit": ("ruamel.yaml", "starlette", "uvicorn"),
    "figures": ("matplotlib",),
    "gp": ("greenlet", "torch"),
    "llm": ("anthropic", "google.genai", "openai", "pydantic_ai"),
    "studies": ("cloudpickle", "jinja2", "optuna", "threadpoolctl"),
}
# Their distributions, if these have other names
DISTRIBUTIONS: Mapping[str, str] = {"google.genai": "google-genai", "pydantic_ai": "pydantic-ai-slim"}


def is_installed(package: str) -> bool:
    """Return True if a package can be imported, without importing it."""
    try:
        return find_spec(package) is not None
    except ModuleNotFoundError:  # its parent package is missing
        return False


def missing_packages(extra: str) -> list[str]:
    """Return the packages of an extra that are not installed."""
    return [package for package in EXTRAS[extra] if not is_installed(package)]


def check_extra(extra: str, subject: str) -> None:
    """Raise MissingExtraError if a package of the extra is not installed; `subject` needs them all."""
    if missing := missing_packages(extra):
        raise _missing(extra, subject, missing)


@contextmanager
def naming_extras(subject: str, extra: str | None = None) -> Generator[None]:
    """Convert failed imports inside the context to MissingExtraError; `subject` needs them.

    `extra` brings them; None for the extra whose package is missing, if it is one of those.
    """
    try:
        yield
    except ImportError as fault:
        name = str(fault.name)
        extra = extra or next((extra for extra, packages in EXTRAS.items() if name in packages), None)
        if extra is None:
            raise
        if isinstance(fault, ModuleNotFoundError):
            raise _missing(extra, subject, missing_packages(extra) or [name]) from fault
        reason = " ".join(str(fault).split())
        raise MissingExtraError(
            f"{subject} needs another version of {name} ({reason}): {install_command(extra)}"
        ) from fault


def install_command(extra: str) -> str:
    """Return the command that installs an extra."""
    return f'pip install "armwright[{extra}]"'


def _missing(extra: str, subject: str, packages: list[str]) -> MissingExtraError:
    *others, last = packages
    named = f"{', '.join(others)} and {last}" if others else last
    return MissingExtraError(f"{subject} needs {named}: {install_command(extra)}")
