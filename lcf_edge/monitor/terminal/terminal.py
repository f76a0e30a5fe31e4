"""A terminal that delivers keys one by one, and is restored however the program ends."""

import os
import select
import signal
import sys
import termios
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from types import FrameType

from rich.console import Console, RenderableType
from rich.live import Live

INTERVAL_S = 0.2
_END_KEYS = frozenset(b"qQ\x03")


def show(
    console: Console, screen: Callable[[], RenderableType], obey: Callable[[bytes], None] = lambda _: None
) -> None:
    """Draw ``screen()`` at 5 Hz over the whole terminal until q is pressed or a signal ends it.

    ``obey`` gets the other keys. Ctrl-Z restores the terminal meanwhile. Raises ``KeyboardInterrupt``,
    ``SystemExit`` for SIGTERM and SIGHUP.
    """
    with _signals() as stopped:
        while True:
            with Live(screen(), console=console, screen=True, auto_refresh=False) as live, _keys() as pressed:
                ended = _draw(live, screen, pressed, obey, stopped)
            if ended:
                return
            os.kill(os.getpid(), signal.SIGSTOP)  # until the shell continues it
            stopped.clear()


def _draw(
    live: Live,
    screen: Callable[[], RenderableType],
    pressed: Callable[[float], bytes],
    obey: Callable[[bytes], None],
    stopped: set[int],
) -> bool:
    """True: q was pressed, or the terminal is gone; False: Ctrl-Z was."""
    due_s = time.monotonic()
    while not stopped:
        live.update(screen(), refresh=True)
        if not live.console.is_terminal:  # any more
            return True
        due_s = max(due_s + INTERVAL_S, time.monotonic())  # missed updates are skipped
        while not stopped and (left_s := due_s - time.monotonic()) > 0:
            keys = pressed(left_s)
            if _END_KEYS & set(keys):
                return True
            if keys:
                obey(keys)
                break  # and the result is shown at once
    return False


@contextmanager
def _signals() -> Iterator[set[int]]:
    """Let SIGTERM and SIGHUP end through cleanup; note a stop in the set."""
    stopped: set[int] = set()

    def end(number: int, _: FrameType | None) -> None:
        sys.exit(128 + number)

    handlers: dict[int, Callable[[int, FrameType | None], object]] = {
        signal.SIGTERM: end,
        signal.SIGHUP: end,
        signal.SIGTSTP: lambda number, _: stopped.add(number),
    }
    with ExitStack() as stack:
        for number, handler in handlers.items():
            stack.callback(signal.signal, number, signal.signal(number, handler))
        yield stopped


@contextmanager
def _keys() -> Iterator[Callable[[float], bytes]]:
    """Yield a function that waits for keys; without a terminal at standard input there are none."""
    if not sys.stdin.isatty():
        yield _no_keys
        return
    file = sys.stdin.fileno()
    before = termios.tcgetattr(file)

    def pressed(timeout_s: float) -> bytes:
        ready, _, _ = select.select([file], [], [], timeout_s)
        if not ready:
            return b""
        with suppress(OSError):
            if keys := os.read(file, 64):
                return keys
        return b"q"  # the terminal is gone

    try:
        tty.setcbreak(file)
        yield pressed
    finally:
        with suppress(termios.error):
            termios.tcsetattr(file, termios.TCSADRAIN, before)


def _no_keys(timeout_s: float) -> bytes:
    time.sleep(timeout_s)
    return b""
