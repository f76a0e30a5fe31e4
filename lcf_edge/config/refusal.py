"""Why a value of the configuration is refused, in the words of the one who wrote it."""

import json
import re
from collections.abc import Sequence
from difflib import get_close_matches
from typing import Any

import msgspec
from msgspec import inspect

from lcf_edge.printable import printable

_MAX_SHOWN = 60  # characters of a value
_MIN_ALIKE = 0.75


def why(tree: dict[str, Any], key: str, table: type[msgspec.Struct]) -> str:
    """Return what ``key`` (``imu.driver``, ``camera.mask[0][1]``) of ``table`` must be, and its value in ``tree``."""
    value: Any = tree
    kind: inspect.Type = inspect.type_info(table)
    for name, place in re.findall(r"(\w+)|\[(\d+)\]", key):
        if name:
            assert isinstance(kind, inspect.StructType)
            value = value[name]
            kind = next(field.type for field in kind.fields if field.name == name)
        else:
            assert isinstance(kind, inspect.ListType)
            value = value[int(place)]
            kind = kind.item_type
        kind = _given(kind)
    if isinstance(kind, inspect.LiteralType):
        return _none_of(value, kind.values)
    secret = isinstance(kind, inspect.ListType) and isinstance(value, str)  # an endpoint, perhaps with secrets
    return f"{_expected(kind)} is needed, not {'a string' if secret else _quoted(value)}"


def _given(kind: inspect.Type) -> inspect.Type:
    """Return the type without the None of an optional key."""
    if isinstance(kind, inspect.UnionType):
        return next(each for each in kind.types if not isinstance(each, inspect.NoneType))
    return kind


def _none_of(value: Any, possible: Sequence[object]) -> str:
    choices = {str(each).lower(): str(each) for each in possible}
    text = value[:_MAX_SHOWN].lower() if isinstance(value, str) else ""
    close = [choices[each] for each in get_close_matches(text, choices, n=2, cutoff=_MIN_ALIKE)]
    hint = f"did you mean {' or '.join(close)}? " if close else ""
    return f"{_quoted(value)} is not allowed; {hint}write one of {', '.join(choices.values())}"


def _expected(kind: inspect.Type) -> str:
    match kind:
        case inspect.IntType():
            return f"a whole number{_bounds(kind)}"
        case inspect.FloatType():
            return f"a number{_bounds(kind)}"
        case inspect.BoolType():
            return "true or false"
        case inspect.StrType():
            return "a string in quotes"
        case inspect.ListType():
            return "a list in brackets"
    return "a table of keys"


def _bounds(kind: inspect.IntType | inspect.FloatType) -> str:
    bounds = (("at least", kind.ge), ("above", kind.gt), ("at most", kind.le), ("below", kind.lt))
    said = [f"{word} {bound:.10g}" for word, bound in bounds if bound is not None]
    return f" ({', '.join(said)})" if said else ""


def _quoted(value: Any) -> str:
    """Quote numbers and texts; of anything larger, which may hold an endpoint's secrets, name only the type."""
    match value:
        case list():
            return "a list"
        case dict():
            return "a table"
        case bool():
            return str(value).lower()
        case str():
            return printable(json.dumps(value, ensure_ascii=False), _MAX_SHOWN)
    return printable(str(value), _MAX_SHOWN)
