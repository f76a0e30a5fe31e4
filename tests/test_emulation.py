"""An emulator is what the kernel runs in place of Python."""

import subprocess
import sys
from pathlib import Path

from tests.emulation import EMULATED

TELL = "from tests.emulation import EMULATED; print(EMULATED)"


def test_a_python_that_another_program_runs_is_taken_for_emulated_and_no_other() -> None:
    """The dynamic loader, started as a program, stands in for an emulator."""
    loader = next(Path("/").glob("lib*/ld-linux-*.so.*"))
    told = [
        subprocess.run((*by, sys.executable, "-c", TELL), check=True, capture_output=True, text=True).stdout.strip()
        for by in ((), (loader,))
    ]
    assert told == [str(EMULATED), "True"]
