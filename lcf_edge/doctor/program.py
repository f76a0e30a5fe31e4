"""How this very program can be called again, by its user and with ``sudo``."""

import shlex
import shutil
import sys
from pathlib import Path

SYSTEM_PATH = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"
"""Where ``sudo`` looks for commands; not in an active virtual environment."""


def program(environment: Path = Path(sys.prefix), path: str = SYSTEM_PATH) -> str:
    """Return, for a shell, ``lcf-edge`` if that name on ``path`` is the program of ``environment``, else its path."""
    script = environment / "bin" / "lcf-edge"
    named = shutil.which("lcf-edge", path=path)
    if named and script.exists() and Path(named).samefile(script):
        return "lcf-edge"
    if script.exists():
        return shlex.quote(str(script))
    return f"{shlex.quote(sys.executable)} -m lcf_edge"
