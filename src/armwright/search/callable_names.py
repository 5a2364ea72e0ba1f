"""Names of functions that users pass in, by which a resumed run recognises them."""

from collections.abc import Iterator
from functools import partial
from types import CodeType, FunctionType, MethodType
from typing import Any
from zlib import crc32


def name_of(value: Any) -> str:
    """Return the name of a callable, or of a value that it captures, which is the same in every process.

    A lambda or a nested function, which has no unique name, is named by its line and a checksum of its code and of the
    values it captures.
    """
    if isinstance(value, partial):
        arguments = [name_of(argument) for argument in value.args]
        arguments += [f"{name}={name_of(argument)}" for name, argument in value.keywords.items()]
        return f"partial({', '.join([name_of(value.func), *arguments])})"
    if isinstance(value, MethodType):
        return f"{name_of(value.__self__)}.{value.__name__}"
    if isinstance(value, FunctionType) and ("<lambda>" in value.__qualname__ or "<locals>" in value.__qualname__):
        captured = [*(value.__defaults__ or ()), *(cell.cell_contents for cell in value.__closure__ or ())]
        # Captured functions by their constants only: a function that captures itself would recurse without end.
        names = [list(_constants(v.__code__)) if isinstance(v, FunctionType) else name_of(v) for v in captured]
        checksum = crc32(repr([*_constants(value.__code__), *names]).encode())
        line = f"line {value.__code__.co_firstlineno} ({checksum:08x})"
        return f"{line} of {value.__module__}, {value.__qualname__}"  # the line first: long settings are shown cut
    if hasattr(value, "__qualname__"):  # functions and classes
        return f"{getattr(value, '__module__', None)}.{value.__qualname__}"
    has_own_repr = type(value).__repr__ is not object.__repr__  # the default one holds an address
    return repr(value) if has_own_repr else f"{name_of(type(value))}()"


def _constants(code: CodeType) -> Iterator[str]:
    """Yield the names that the code of a function uses, and its constants."""
    yield from code.co_names
    for value in code.co_consts:
        if isinstance(value, CodeType):
            yield from _constants(value)
        else:
            yield repr(value)
