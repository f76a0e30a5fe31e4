"""TOML of a size and depth that a configuration can have; what is larger is refused before it is parsed.

The parser's memory grows with the square of a key's depth: 40 kB of dots would take more than a gigabyte.
"""

import re
import tomllib
from typing import Any

MAX_BYTES = 2**16
DEEPEST = 4  # tables or lists in each other, and parts of a dotted key

# Strings and comments, whose dots and brackets count for nothing. As TOML 1.0 has them: where a string is not ended
# here, the parser ends too.
_TEXT = re.compile(
    r'"""(?:\\.|[^\\])*?"""(?:"{0,2})'
    r"|'''.*?'''(?:'{0,2})"
    r'|"(?:\\[^\n]|[^"\\\n])*"'
    r"|'[^'\n]*'"
    r"|#[^\n]*",
    re.DOTALL,
)
_LONG_NUMBER = re.compile(r"\b0[xob]\w{1000}")  # decimal ones the parser refuses by itself
_BRACKET = re.compile(r"[\[\]{}]")
_DEEP_KEY = re.compile(rf"[\w-](?:[ \t]*\.[ \t]*[\w-]+){{{DEEPEST}}}")


class TomlError(ValueError):
    """No TOML that can be taken; the text says why."""


def parse(text: str) -> dict[str, Any]:
    """The tables of ``text``. Raises ``TomlError``."""
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
