"""The system's clock: set, synchronised, and fine enough."""

import ctypes
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass

from lcf_edge.doctor.finding import Context, Finding, ok, warn

_UNSYNCHRONISED = 5  # TIME_ERROR of adjtimex(2)
_EARLIEST_S = 1_735_689_600  # 2025; before it the clock was never set
_COARSE_S = 1e-4


class _Timex(ctypes.Structure):
    """The beginning of ``struct timex``, padded to its size."""

    _fields_ = (
        ("modes", ctypes.c_uint),  # 0: nothing is changed
        ("offset", ctypes.c_long),
        ("freq", ctypes.c_long),
        ("maxerror_us", ctypes.c_long),
        ("rest", ctypes.c_byte * 256),
    )


@dataclass(frozen=True, slots=True)
class SystemClock:
    """``max_error_s``: the kernel's estimate of its largest error."""

    now_s: float
    synchronised: bool
    max_error_s: float
    resolution_s: float
    source: str  # the kernel's clock source


def check(context: Context) -> Iterator[Finding]:
    """Check that the clock is set and fine enough."""
    folder = context.sys / "devices/system/clocksource/clocksource0/current_clocksource"
    yield from judged(_read(folder.read_text(encoding="ascii").strip() if folder.exists() else "unknown"))


def judged(clock: SystemClock) -> Iterator[Finding]:
    """Return findings about a clock."""
    if clock.now_s < _EARLIEST_S:
        year = time.gmtime(clock.now_s).tm_year
        yield warn("clock", f"it says {year}: it was never set, so the stamps of scenes are wrong", _SET)
    elif clock.synchronised:
        yield ok("clock", f"synchronised, off by {clock.max_error_s:.3f} s at most")
    else:
        yield warn("clock", "not synchronised: stamps will not agree with those of other computers", _SET)
    if clock.resolution_s > _COARSE_S:
        yield warn("clock", f"the monotonic clock steps by {1e3 * clock.resolution_s:.1f} ms: stamps are coarse")
    else:
        yield ok("clock", f"monotonic in steps of {1e9 * clock.resolution_s:.0f} ns, source {clock.source}")


_SET = "sudo timedatectl set-ntp true  # or, where another computer has the time: sudo apt install chrony"


def _read(source: str) -> SystemClock:
    state = _Timex()
    answer = ctypes.CDLL(None, use_errno=True).adjtimex(ctypes.byref(state))
    if answer < 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()), "adjtimex")
    return SystemClock(
        time.time(),
        answer != _UNSYNCHRONISED,
        state.maxerror_us / 1e6,
        time.clock_getres(time.CLOCK_MONOTONIC),
        source,
    )
