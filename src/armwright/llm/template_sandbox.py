"""Render prompt templates, which may be files by strangers, in Jinja's sandbox."""

from collections.abc import Mapping
from typing import Any

from jinja2 import PackageLoader, StrictUndefined, Template, TemplateRuntimeError
from jinja2.exceptions import SecurityError
from jinja2.runtime import BlockReference, Context, LoopContext, Macro
from jinja2.sandbox import ImmutableSandboxedEnvironment
from jinja2.utils import Cycler, Joiner

from armwright.spaces.parameters import exact

MAX_PROMPT = 1_000_000  # characters
_CALLABLE = (str, list, tuple, Mapping, Macro, BlockReference, LoopContext, Cycler, Joiner)


class Sandbox(ImmutableSandboxedEnvironment):
    """Jinja's immutable sandbox, in which only text, containers and Jinja's own objects can be called.

    Methods of tasks, spaces and arrays could write files, or unpickle what the template holds. Time and memory are not
    limited. The output is a prompt, not a page: nothing is escaped.
    """

    def __init__(self, package: str) -> None:
        super().__init__(loader=PackageLoader(package), undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
        self.filters["exact"] = exact
        del self.filters["random"], self.globals["lipsum"]  # a prompt depends on its seed alone

    def is_safe_callable(self, obj: Any) -> bool:
        """Return whether a template may call `obj`."""
        if not super().is_safe_callable(obj):
            return False
        method = getattr(obj, "__wrapped__", obj)  # Jinja wraps `format` of a text
        return any(obj is own for own in self.globals.values()) or isinstance(
            getattr(method, "__self__", method), _CALLABLE
        )

    def call(__self, __context: Context, __obj: Any, *args: Any, **kwargs: Any) -> Any:  # noqa: N805 as Jinja's
        """Call `__obj` on behalf of a template."""
        if not __self.is_safe_callable(__obj):  # Jinja's own error shows the whole object
            raise SecurityError(f"{getattr(__obj, '__name__', type(__obj).__name__)} cannot be called in a template")
        return super().call(__context, __obj, *args, **kwargs)


def render(template: Template, values: Mapping[str, Any]) -> str:
    """Return the text of a template.

    Raises:
        TemplateRuntimeError: The text is longer than MAX_PROMPT.
    """
    pieces: list[str] = []
    length = 0
    for piece in template.generate(values):
        length += len(piece)
        if length > MAX_PROMPT:
            raise TemplateRuntimeError(f"it is longer than {MAX_PROMPT:,} characters")
        pieces.append(piece)
    return "".join(pieces)
