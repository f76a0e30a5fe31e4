"""Write docs/api.md from the docstrings of what is public: ``python docs/api.py``."""

import ast
import inspect
import re
from collections.abc import Callable, Iterator
from enum import IntEnum
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from lcf_edge import client, errors, messages
from lcf_edge.sinks import sink

PAGE = Path(__file__).parent / "api.md"
HEAD = """# API reference

Written by `python docs/api.py` from the docstrings; [planners.md](planners.md) and
[developing.md](developing.md#a-new-sink) show how it is used.
"""
RECORDS = ("CIRCLE", "PSI_REGION", "OBJECT")
ENUMERATIONS = ("Kind", "Cause", "ObjectClass", "ObjectState", "Shape")
PARTS: tuple[tuple[ModuleType, tuple[str, ...]], ...] = (
    (client, ("scenes", "Scenes")),
    (messages, ("Scene", *RECORDS, *ENUMERATIONS, "PipelineScene", "Sizes", "Timing", "View")),
    (sink, ("Sink",)),
    (errors, ("LcfError", "UsageError", "ConfigError", "RecordingError", "PublishError")),
)
"""Modules and the names of each that others may build on."""


def page() -> str:
    """Return the whole page."""
    parts = [HEAD]
    for module, names in PARTS:
        parts.append(f"## {module.__name__}\n\n{_text(module.__doc__)}\n")
        parts += [f"{_entry(module, name)}\n" for name in names]
    return "\n".join(parts)


def _entry(module: ModuleType, name: str) -> str:
    thing = getattr(module, name)
    if isinstance(thing, np.dtype):
        return (
            f"### {name}\n\n{_text(_doc_of_constant(module, name))} Its fields: [wire format](wire-format.md#messages)."
        )
    lines = [f"### {name}", ""]
    if not isinstance(thing, type):
        return "\n".join([*lines, f"`{_signature(name, thing)}`", "", _text(thing.__doc__)])
    base = thing.__bases__[0]
    lines.append(f"`{name}({base.__name__})`: {_text(thing.__doc__)}" if base is not object else _text(thing.__doc__))
    if fields := list(_fields_of_class(thing)):
        lines += ["", *fields]
    for method, function in vars(thing).items():
        if inspect.isfunction(function) and not method.startswith("_"):
            lines += ["", f"`{_signature(method, function)}`: {_text(function.__doc__)}"]
    return "\n".join(lines)


def _signature(name: str, function: Callable[..., Any]) -> str:
    signature = inspect.signature(function, eval_str=True)
    others = [each for each in signature.parameters.values() if each.name != "self"]
    return re.sub(r"\b[a-z_.]+\.(?=[A-Z])", "", f"{name}{signature.replace(parameters=others)}")


def _fields_of_class(thing: type) -> Iterator[str]:
    """Lines on members of an enumeration, or on annotated fields, whose comment says what they are."""
    source = inspect.getsource(thing)
    (definition,) = ast.parse(source).body
    assert isinstance(definition, ast.ClassDef)
    fields = []
    for node in definition.body:
        comment = _comment(source.splitlines()[node.lineno - 1])
        if isinstance(node, ast.Assign) and issubclass(thing, IntEnum):
            fields.append((f"`{ast.unparse(node)}`", comment))
        elif isinstance(node, ast.AnnAssign):
            kind = ast.unparse(node.annotation).replace("npt.", "")
            fields.append((f"`{ast.unparse(node.target)}: {kind}`", comment))
    if any(comment for _, comment in fields):
        yield from (f"- {field}: {comment}" if comment else f"- {field}" for field, comment in fields)
    elif fields:
        yield ", ".join(field for field, _ in fields)


def _comment(line: str) -> str:
    return line.partition("  # ")[2].strip()


def _doc_of_constant(module: ModuleType, name: str) -> str:
    """The text right behind a module's constant."""
    body = ast.parse(inspect.getsource(module)).body
    for node, after in pairwise(body):
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == name:
            assert isinstance(after, ast.Expr)
            assert isinstance(after.value, ast.Constant)
            return str(after.value.value)
    raise KeyError(name)


def _text(docstring: str | None) -> str:
    return inspect.cleandoc(docstring or "").replace("``", "`")


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
