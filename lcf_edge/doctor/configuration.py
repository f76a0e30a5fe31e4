"""Whether there is a configuration that can be used, and where it comes from."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import msgspec

from lcf_edge.config import DEFAULT_PATH, Config, bounded_toml, load
from lcf_edge.doctor.finding import Context, Finding, edit, fail, ok
from lcf_edge.errors import ConfigError


def context_of(path: Path | None, settings: Sequence[str]) -> Context:
    """The context for a configuration file and ``--set``; never raises ``ConfigError``, but holds it."""
    try:
        config = load(path, settings)
    except ConfigError as error:
        return Context(Config(), path or DEFAULT_PATH, error=error)
    return Context(config, path or DEFAULT_PATH, tuple(settings), _given(path or DEFAULT_PATH, settings, config))


def check(context: Context) -> Iterator[Finding]:
    """The configuration as a whole."""
    if context.error is not None:
        yield fail(
            "configuration",
            f"{context.error}; camera, IMU, memory and network are checked once it is fixed",
            edit(context.path) if str(context.path) in str(context.error) else "",
        )
    elif context.path.exists():
        yield ok("configuration", f"{context.path} is valid")
    else:
        yield ok("configuration", f"there is no {context.path}: defaults apply")


def _given(path: Path, settings: Sequence[str], config: Config) -> frozenset[str]:
    """The keys that a valid configuration sets; that of a recording sets all."""
    if path.suffix.lower() == ".mcap":
        tables = msgspec.to_builtins(config)
    else:
        tables = bounded_toml.parse(path.read_text(encoding="utf-8")) if path.exists() else {}
    in_file = {f"{table}.{key}" for table, keys in tables.items() for key in keys}
    return frozenset(in_file | {setting.partition("=")[0].strip() for setting in settings})
