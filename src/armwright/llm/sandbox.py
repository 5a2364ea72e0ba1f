"""Where templates are rendered. They are files that people pass on: none may reach beyond its prompt, or not end."""

import math
import re
import threading
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from types import BuiltinMethodType, MethodType
from typing import Any, cast

import numpy as np
from jinja2 import PackageLoader, StrictUndefined, Template, TemplateRuntimeError, Undefined, nodes, pass_context
from jinja2.compiler import CodeGenerator, Frame
from jinja2.exceptions import SecurityError
from jinja2.meta import TrackingCodeGenerator
from jinja2.runtime import BlockReference, Context, LoopContext, Macro
from jinja2.sandbox import ImmutableSandboxedEnvironment
from jinja2.utils import Cycler, Joiner, Namespace

from armwright.parameters import exact

LARGEST_PROMPT = 1_000_000  # characters
MOST_STEPS = 100_000  # rounds of loops and calls of macros in one prompt
MOST_MADE = 10_000_000  # characters that one prompt may make on its way, in variables, too

# What a template may call: of texts and containers these methods, else jinja's own. All else, such as the methods of
# tasks, spaces and arrays, could write files, and make more than can be foreseen.
_TEXTS = """capitalize casefold center count endswith expandtabs find format format_map index isalnum isalpha isascii
isdecimal isdigit islower isnumeric isspace istitle isupper join ljust lower lstrip partition removeprefix removesuffix
replace rfind rindex rjust rpartition rsplit rstrip split splitlines startswith strip swapcase title upper zfill"""
_METHODS: Mapping[type, frozenset[str]] = {
    str: frozenset(_TEXTS.split()),
    list: frozenset(("count", "index")),
    tuple: frozenset(("count", "index")),
    Mapping: frozenset(("get", "items", "keys", "values")),
}
# Methods and filters that pad by numbers given to them, and filters that give back what they are given.
_PADDING = frozenset(("batch", "center", "expandtabs", "indent", "ljust", "rjust", "slice", "tojson", "zfill"))
_CHOOSING = frozenset(("d", "default"))


class _CountingGenerator(CodeGenerator):
    """Compiles a template so that all that takes time or room is counted: rounds of loops, calls, and text."""

    def visit_For(self, node: nodes.For, frame: Frame) -> None:  # noqa: N802 jinja's name
        node.body.insert(0, _statement("step", node))
        super().visit_For(node, frame)

    def visit_Macro(self, node: nodes.Macro, frame: Frame) -> None:  # noqa: N802
        node.body.insert(0, _statement("step", node))
        super().visit_Macro(node, frame)

    def visit_Output(self, node: nodes.Output, frame: Frame) -> None:  # noqa: N802
        size = sum(len(child.data) for child in node.nodes if isinstance(child, nodes.TemplateData))
        if size and not (frame.require_output_check and self.has_known_extends):
            self.visit(_statement("made", node, nodes.Const(size)), frame)
        super().visit_Output(node, frame)

    def visit_Filter(self, node: nodes.Filter, frame: Frame) -> None:  # noqa: N802
        if node.name not in self.environment.filters:
            self.fail(f"No filter named {node.name!r}.", node.lineno)
        if node.node is None:
            self.fail("a filter for a whole block is not possible here; write {{ text | filter }}", node.lineno)
        given = [nodes.Const(node.name), node.node, *node.args]
        self.visit(_call("filtered", node, given, node.kwargs, node.dyn_args, node.dyn_kwargs), frame)

    def visit_Const(self, node: nodes.Const, frame: Frame) -> None:  # noqa: N802
        if isinstance(node.value, float) and not math.isfinite(node.value):  # jinja would write the name inf
            self.fail("a number is too large", node.lineno)
        super().visit_Const(node, frame)

    def visit_Concat(self, node: nodes.Concat, frame: Frame) -> None:  # noqa: N802
        self.visit(_call("joined", node, node.nodes), frame)

    def visit_Getitem(self, node: nodes.Getitem, frame: Frame) -> None:  # noqa: N802
        if not isinstance(node.arg, nodes.Slice):
            super().visit_Getitem(node, frame)
            return
        # Jinja does not ask its environment for a part.
        self.write("environment.part(")
        super().visit_Getitem(node, frame)
        self.write(")")


@dataclass(frozen=True)
class _Bounded:
    """A function that counts by itself what it makes."""

    function: Callable[..., Any]

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        return self.function(*args, **kwargs)


class Sandbox(ImmutableSandboxedEnvironment):
    """Jinja without a way out, without chance, and with an end: in time as in room.

    The output is a prompt, not a page: nothing is escaped.
    """

    code_generator_class = _CountingGenerator
    intercepted_binops = frozenset({"+", "*", "**", "%"})

    def __init__(self, package: str) -> None:
        super().__init__(
            loader=PackageLoader(package),
            undefined=StrictUndefined,
            trim_blocks=True,
            lstrip_blocks=True,
            optimized=False,  # what is worked out while a template is read would not be counted
            finalize=self._shown,
        )
        self._count = threading.local()
        self.filters["exact"] = exact
        del self.filters["random"], self.globals["lipsum"]  # a prompt depends on its seed alone
        del self.filters["pprint"]

    def rendered(self, template: Template, values: Mapping[str, Any]) -> str:
        """The text; TemplateRuntimeError where it becomes too long, or takes too long."""
        self._count.steps = self._count.made = 0
        pieces: list[str] = []
        length = 0
        for piece in template.generate(values):
            length += len(piece)
            if length > LARGEST_PROMPT:
                raise TemplateRuntimeError(f"it is longer than {LARGEST_PROMPT:,} characters")
            pieces.append(piece)
        return "".join(pieces)

    def names_needed(self, tree: nodes.Template) -> set[str]:
        """The names that a template uses and does not make. (`meta.find_undeclared_variables` works out constants.)"""
        finder = TrackingCodeGenerator(self)
        finder.optimizer = None
        finder.visit(tree)
        return finder.undeclared_identifiers

    def step(self) -> None:
        """One more round of a loop, or call of a macro."""
        self._count.steps = getattr(self._count, "steps", 0) + 1
        if self._count.steps > MOST_STEPS:
            raise TemplateRuntimeError(f"its loops go on for more than {MOST_STEPS:,} rounds")

    def made(self, size: float) -> None:
        """So many characters more; asked before they are made."""
        self._count.made = getattr(self._count, "made", 0) + size
        if self._count.made > MOST_MADE:
            raise TemplateRuntimeError(f"it makes more than {MOST_MADE:,} characters on its way")

    def joined(self, *values: Any) -> str:
        """What ~ makes of values."""
        self.made(sum(map(text_size, values)))
        return "".join(map(str, values))

    def part(self, value: Any) -> Any:
        """A part of a text or a list, which is a copy."""
        self.made(text_size(value))
        return value

    @pass_context
    def filtered(self, context: Context, name: str, value: Any, *args: Any, **kwargs: Any) -> Any:
        """What a filter makes of a value."""
        return self.call_filter(name, value, args, kwargs, context)

    def call_filter(
        self, name: str, value: Any, args: Any = None, kwargs: Any = None, context: Any = None, eval_ctx: Any = None
    ) -> Any:
        """Also for filters that `map` is told."""
        args, kwargs = tuple(args or ()), dict(kwargs or {})
        if isinstance(value, Iterator):
            value = self._counted(cast("Iterator[Any]", value))
        self.made(_result_size(name, value, [*args, *kwargs.values()]))
        return super().call_filter(name, value, args, kwargs, context, eval_ctx)

    def call_binop(self, context: Context, operator: str, left: Any, right: Any) -> Any:
        """Sums, products, powers and formats, of a size that can be meant."""
        size = _size(operator, left, right)
        if size > LARGEST_PROMPT and operator != "%":
            raise TemplateRuntimeError(f"what {operator} makes is too large")
        self.made(size)
        return super().call_binop(context, operator, left, right)

    def call(__self, __context: Context, __obj: Any, *args: Any, **kwargs: Any) -> Any:  # noqa: N805 as jinja's
        """A method of a text, of a size that can be meant; or what else may be called."""
        on = getattr(__obj, "__self__", None)
        if on is __self:  # written into the template by the generator above
            return __context.call(__obj, *args, **kwargs)
        if not __self.is_safe_callable(__obj):
            name = getattr(__obj, "__name__", type(__obj).__name__)
            raise SecurityError(f"{name} cannot be called in a template")
        if isinstance(on, str):
            # Names with an underscore are jinja's own.
            given = [*args, *(value for name, value in kwargs.items() if not name.startswith("_"))]
            given = [list(__self._counted(cast("Iterator[Any]", v))) if isinstance(v, Iterator) else v for v in given]
            __self.made(_result_size(__obj.__name__, on, given))
            args = tuple(given[: len(args)])
        return super().call(__context, __obj, *args, **kwargs)

    def is_safe_callable(self, obj: Any) -> bool:
        """Methods of texts and containers that change nothing, and jinja's own things."""
        if not super().is_safe_callable(obj):
            return False
        if isinstance(obj, (Macro, BlockReference, LoopContext, Joiner, _Bounded)):
            return True
        if any(obj is own for own in self.globals.values()):
            return True
        if not isinstance(obj, (MethodType, BuiltinMethodType)):
            return False
        on = obj.__self__
        if isinstance(on, (LoopContext, Cycler)):
            return True
        return any(isinstance(on, kind) and obj.__name__ in names for kind, names in _METHODS.items())

    def wrap_str_format(self, value: Any) -> Any:
        """Jinja's own safe `format` of a text, of a size that can be meant."""
        inner = super().wrap_str_format(value)
        if inner is None:
            return None

        def bounded(*args: Any, **kwargs: Any) -> str:
            self.made(_format_size(value.__self__, [*args, *kwargs.values()]))
            return inner(*args, **kwargs)

        return _Bounded(bounded)

    def getattr(self, obj: Any, attribute: str) -> Any:
        """An attribute; arrays are made anew each time."""
        value: Any = super().getattr(obj, attribute)
        if isinstance(value, np.ndarray):
            self.made(value.nbytes)
        return cast("Any", value)

    @pass_context
    def _shown(self, context: Context, value: Any) -> Any:
        """A value that is about to become text of the prompt."""
        self.made(text_size(value))
        return value

    def _counted(self, values: Iterator[Any]) -> Iterator[Any]:
        for value in values:
            self.made(text_size(value))
            yield value


def text_size(value: Any) -> int:
    """About how many characters a value has as text; of more than MOST_MADE, no less than that."""
    return MOST_MADE - _left(value, MOST_MADE)


def _left(value: Any, most: int) -> int:
    """How many of `most` characters a value's text leaves; below 0 where it is longer."""
    if isinstance(value, str):
        return most - len(value)
    if isinstance(value, (bool, int, float, Undefined, type(None), Iterator)):
        return most - (4 + value.bit_length() // 3 if isinstance(value, int) else 24)
    if isinstance(value, np.ndarray):
        return most - 24 * value.size
    if isinstance(value, Namespace):
        value = object.__getattribute__(value, "_Namespace__attrs")
    if not isinstance(value, Collection):
        return most - len(str(value))
    items: Iterable[Any] = cast("Iterable[Any]", value)
    if isinstance(value, Mapping):
        items = (part for pair in cast("Mapping[Any, Any]", value).items() for part in pair)
    for item in items:
        most = _left(item, most - 8)
        if most < 0:
            break
    return most


def _result_size(name: str, value: Any, given: list[Any]) -> int:
    """About how large the result of a filter or a method becomes, at most."""
    size = text_size(value)
    if name == "format" and isinstance(value, str):
        return _percent_size(value, given)  # the filter; the method counts by itself
    if name == "replace" and isinstance(value, str) and len(given) > 1:
        return size + value.count(str(given[0])) * text_size(given[1])
    texts = sum(text_size(v) for v in given if not isinstance(v, (bool, int, float, type(None))))
    if name in _CHOOSING:
        return size + texts
    widths = sum(abs(v) for v in given if isinstance(v, int)) if name in _PADDING else 0
    return (size + 1) * (1 + texts + widths)


def _format_size(text: str, given: list[Any]) -> int:
    """Of `text.format(...)`: each field may show all that is given, and widths may be given, too."""
    fields, sizes = text.count("{"), sum(map(text_size, given))
    if re.search(r":[^{}]*\{", text):
        sizes += sum(abs(v) for v in given if isinstance(v, int))
    return len(text) + _numbers(text) + fields * sizes


def _percent_size(text: str, given: Any) -> int:
    """Of `text % given`: each field may show all that is given, and widths may be given, too."""
    sizes = text_size(given)
    if "*" in text:
        values: list[Any] = list(cast("Any", given)) if isinstance(given, (list, tuple)) else [given]
        sizes += sum(abs(v) for v in values if isinstance(v, int))
    return len(text) + _numbers(text) + text.count("%") * sizes


def _numbers(text: str) -> int:
    """The sum of all numbers in a text, which may be widths; of more than nine digits none is meant."""
    return sum(int(digits) if len(digits) < 10 else MOST_MADE for digits in re.findall(r"\d+", text))


def _size(operator: str, left: Any, right: Any) -> float:
    """About how large what an operator makes becomes: characters, items or bits."""
    if operator == "%":
        return _percent_size(left, right) if isinstance(left, str) else 0.0
    if isinstance(left, int) and isinstance(right, int):
        bits = left.bit_length()
        size = bits * max(0, right) if operator == "**" else bits + right.bit_length()
        return size if size > 1000 else 0.0
    if operator == "+":
        return float(sum(text_size(value) for value in (left, right) if isinstance(value, (str, list, tuple))))
    for many, times in ((left, right), (right, left)):
        if isinstance(many, (str, bytes, list, tuple)) and isinstance(times, int):
            return len(many) * max(0, times)  # pyright: ignore[reportUnknownArgumentType]
    return 0.0


def _call(
    name: str, at: nodes.Node, given: list[nodes.Expr], kwargs: Any = (), dyn_args: Any = None, dyn_kwargs: Any = None
) -> nodes.Call:
    """A call of a method of the sandbox, in a template."""
    call = nodes.Call(nodes.EnvironmentAttribute(name), given, list(kwargs), dyn_args, dyn_kwargs)
    call.set_lineno(at.lineno)
    return call


def _statement(name: str, at: nodes.Node, *given: nodes.Expr) -> nodes.Node:
    """Such a call as a statement."""
    return nodes.ExprStmt(_call(name, at, list(given))).set_lineno(at.lineno)
