"""Where templates are rendered. They are files that people pass on: none may reach beyond its prompt, or not end."""

import threading
from collections.abc import Mapping
from typing import Any

from jinja2 import PackageLoader, StrictUndefined, Template, TemplateRuntimeError, nodes
from jinja2.compiler import CodeGenerator, Frame
from jinja2.runtime import Context
from jinja2.sandbox import ImmutableSandboxedEnvironment

from armwright.space import exact

LARGEST_PROMPT = 1_000_000  # characters
MOST_STEPS = 100_000  # rounds of loops and calls of macros in one prompt


class _CountingGenerator(CodeGenerator):
    """Compiles a template so that every round of a loop and every call of a macro is counted."""

    def visit_For(self, node: nodes.For, frame: Frame) -> None:  # noqa: N802 jinja's name
        node.body.insert(0, _step(node))
        super().visit_For(node, frame)

    def visit_Macro(self, node: nodes.Macro, frame: Frame) -> None:  # noqa: N802
        node.body.insert(0, _step(node))
        super().visit_Macro(node, frame)


class Sandbox(ImmutableSandboxedEnvironment):
    """Jinja without a way out, without chance, and with an end.

    The output is a prompt, not a page: nothing is escaped.
    """

    code_generator_class = _CountingGenerator
    intercepted_binops = frozenset({"*", "**"})

    def __init__(self, package: str) -> None:
        super().__init__(loader=PackageLoader(package), undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
        self._count = threading.local()
        self.filters["exact"] = exact
        del self.filters["random"], self.globals["lipsum"]  # a prompt depends on its seed alone

    def rendered(self, template: Template, values: Mapping[str, Any]) -> str:
        """The text; TemplateRuntimeError where it becomes too long, or takes too long."""
        self._count.steps = 0
        pieces: list[str] = []
        length = 0
        for piece in template.generate(values):
            length += len(piece)
            if length > LARGEST_PROMPT:
                raise TemplateRuntimeError(f"it is longer than {LARGEST_PROMPT:,} characters")
            pieces.append(piece)
        return "".join(pieces)

    def step(self) -> None:
        """One more round of a loop, or call of a macro."""
        self._count.steps = getattr(self._count, "steps", 0) + 1
        if self._count.steps > MOST_STEPS:
            raise TemplateRuntimeError(f"its loops go on for more than {MOST_STEPS:,} rounds")

    def call_binop(self, context: Context, operator: str, left: Any, right: Any) -> Any:
        """Products and powers, of a size that can be meant."""
        if _size(operator, left, right) > LARGEST_PROMPT:
            raise TemplateRuntimeError(f"what {operator} makes is too large")
        return super().call_binop(context, operator, left, right)


def _size(operator: str, left: Any, right: Any) -> float:
    """About how large a product or a power becomes: characters, items or bits."""
    if isinstance(left, int) and isinstance(right, int):
        bits = left.bit_length()
        return bits * max(0, right) if operator == "**" else bits + right.bit_length()
    for many, times in ((left, right), (right, left)):
        if isinstance(many, (str, bytes, list, tuple)) and isinstance(times, int):
            return len(many) * max(0, times)  # pyright: ignore[reportUnknownArgumentType]
    return 0.0


def _step(node: nodes.Node) -> nodes.Node:
    call = nodes.Call(nodes.EnvironmentAttribute("step"), [], [], None, None)
    return nodes.ExprStmt(call).set_lineno(node.lineno)
