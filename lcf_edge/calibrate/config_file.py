"""Values into a configuration file: comments and other keys stay, and the file is replaced whole or not at all."""

import os
import shutil
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

import tomlkit
from tomlkit.exceptions import TOMLKitError

from lcf_edge.calibrate.result import Value
from lcf_edge.config import load
from lcf_edge.errors import ConfigError


def as_toml(table: str, values: Mapping[str, Value]) -> str:
    """Return the values as lines of TOML."""
    document = tomlkit.document()
    document[table] = dict(values)
    return tomlkit.dumps(document).strip()


def check_writable(path: Path) -> None:
    """Refuse a file that cannot be written, before any measurement. Raises ``ConfigError``."""
    if not path.is_file():
        raise ConfigError(f"{path}: no such file; name yours with -c, or create an empty one")
    if not (os.access(path, os.W_OK) and os.access(path.resolve().parent, os.W_OK)):
        raise ConfigError(f"{path}: no permission to write; use sudo, or name another file with -c")


def write(path: Path, table: str, values: Mapping[str, Value]) -> None:
    """Set the keys of ``table`` in the TOML file ``path``.

    Raises ``ConfigError``, with the file as it was, when it cannot be written or would not be valid.
    """
    target = path.resolve()  # a symbolic link is kept
    try:
        document = tomlkit.parse(target.read_text(encoding="utf-8"))
        section = document.setdefault(table, tomlkit.table())
        for key, value in values.items():
            section[key] = value
        _replace(target, tomlkit.dumps(document))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written ({error.strerror}); use sudo, or name another file") from error
    except (TOMLKitError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: not valid TOML ({error}); fix it first") from error


def _replace(target: Path, text: str) -> None:
    handle, name = tempfile.mkstemp(suffix=".toml", prefix=f".{target.name}.", dir=target.parent)
    new = Path(name)
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        try:
            load(new)
        except ConfigError as error:
            reason = str(error).removeprefix(f"{new}: ")
            raise ConfigError(f"{target}: left as it was, it would not be valid: {reason}") from error
        owner = target.stat()
        with suppress(PermissionError):  # only root may change the owner
            os.chown(new, owner.st_uid, owner.st_gid)
        shutil.copymode(target, new)
        new.replace(target)
    finally:
        new.unlink(missing_ok=True)
