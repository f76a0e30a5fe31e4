"""Whether the tests run on an emulated processor (``make test-arm64``): slower, and some things cannot be measured."""

import sys
from pathlib import Path

import pytest

EMULATED = not Path("/proc/self/exe").samefile(sys.executable)
"""Whether the kernel runs another program than this Python: the emulator."""

SLOWNESS = 10 if EMULATED else 1
"""By how much times are longer there, also in which something must have happened."""


def needs_the_processor(reason: str) -> pytest.MarkDecorator:
    """Skip a test where the processor is emulated, for that reason."""
    return pytest.mark.skipif(EMULATED, reason=f"emulated processor: {reason}")
