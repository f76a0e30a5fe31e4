"""TOML of bounded size and depth; what is larger is refused before it is parsed.

The parser's memory grows with the square of a key's depth: 40 kB of dots would take more than a gigabyte.
"""

import re
import tomllib
from typing import Any

MAX_BYTES = 2**16
DEEPEST = 4  # nested tables or lists, and parts of a dotted key

# Strings and comments, whose dots and brackets do not count, by TOML 1.0. A string that does not end, which the parser
# refuses too, goes as far as it can: nothing is searched twice, and the time stays proportional to the size.
_TEXT = re.compile(
    r'"""(?:\\.|[^\\])*?(?:"{3,5}|\\?\Z)'
    r"|'''.*?(?:'{3,5}|\Z)"
    r'|"(?:\\[^\n]|[^"\\\n])*"?'
    r"|'[^'\n]*'?"
    r"|#[^\n]*",
    re.DOTALL,
)
_LONG_NUMBER = re.compile(r"\b0[xob]\w{1000}")  # the parser itself refuses decimal ones
_BRACKET = re.compile(r"[\[\]{}]")
_DEEP_KEY = re.compile(rf"[\w-](?:[ \t]*\.[ \t]*[\w-]+){{{DEEPEST}}}")


class TomlError(ValueError):
    """TOML that is refused; the text says why."""


def parse(text: str) -> dict[str, Any]:
    """Parse ``text``. Raises ``TomlError``."""
    if len(text) > MAX_BYTES:
        raise TomlError(f"more than {MAX_BYTES // 1024} KiB")
    skeleton = _TEXT.sub(lambda found: "" if found[0].startswith("#") else "s", text)
    if _DEEP_KEY.search(skeleton) or _depth(skeleton) > DEEPEST:
        raise TomlError("nested too deeply")
    if _LONG_NUMBER.search(skeleton):
        raise TomlError("a number of a thousand digits")
    try:
        return tomllib.loads(text)
    except ValueError as error:  # also a number of thousands of digits
        raise TomlError(str(error)) from error


def _depth(skeleton: str) -> int:
    deepest = depth = 0
    for bracket in _BRACKET.findall(skeleton):
        depth = max(depth + (1 if bracket in "[{" else -1), 0)
        deepest = max(deepest, depth)
    return deepest
