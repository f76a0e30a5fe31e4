"""``lcf-edge watch``: shows a running daemon, or a recording, in a terminal or line by line."""
# ruff: noqa: PLC0415

import time
from collections.abc import Callable
from contextlib import closing, suppress
from typing import TYPE_CHECKING

import msgspec

from lcf_edge.config.endpoint import bare
from lcf_edge.errors import LcfError
from lcf_edge.monitor.live.daemon_address import DaemonAddress
from lcf_edge.monitor.live.lines import scene_fields
from lcf_edge.monitor.replay.replayed import Replayed
from lcf_edge.zenoh_link.scene import scene_key
from lcf_edge.zenoh_link.subscription import scenes

if TYPE_CHECKING:
    from lcf_edge.monitor.replay.player import Player

PLAIN_INTERVAL_S = 1.0
PLAIN_LINES = 100


def watch_lines(address: DaemonAddress, write_line: Callable[[str], None]) -> None:
    """Print one JSON object a scene, until interrupted. Raises ``PublishError``."""
    with closing(scenes(address.endpoint, scene_key(address.prefix), config_file=address.config_file)) as arriving:
        for scene in arriving:
            write_line(msgspec.json.encode(scene_fields(scene)).decode())


def watch_table(shown: DaemonAddress | Replayed, write_line: Callable[[str], None]) -> None:
    """Show the table until q or Ctrl-C; where standard output is no terminal, pass plain text to ``write_line``.

    Raises ``PublishError``, ``RecordingError``, and ``LcfError`` without the extra ``watch`` or when the terminal is
    closed.
    """
    try:
        from rich.console import Console
    except ImportError as error:
        raise LcfError("watch: rich is missing; run pip install 'lcf-edge[watch]', or use --json") from error
    from lcf_edge.monitor.live.monitor import Monitor
    from lcf_edge.monitor.terminal.screen import Screen
    from lcf_edge.monitor.terminal.terminal import show

    console = Console(highlight=False, markup=False, emoji=False)
    if isinstance(shown, DaemonAddress):
        watched: Monitor | Player = Monitor(shown)
        place = bare(shown.endpoint)
        obey: Callable[[bytes], None] = _ignore
    else:
        from lcf_edge.monitor.terminal.player_keys import PlayerKeys

        watched = player = shown.player()
        place, obey = str(shown.path), PlayerKeys(player).obey
        player.start()
    with closing(watched), suppress(KeyboardInterrupt):

        def screen() -> Screen:
            return Screen(watched.snapshot(), place, time.time_ns())

        if console.is_terminal and not console.is_dumb_terminal:
            try:
                show(console, screen, obey)
            except OSError as error:
                raise LcfError(f"watch: the terminal is gone ({error.strerror})") from error
            return
        while True:
            with console.capture() as text:
                console.print(screen(), height=PLAIN_LINES)
            write_line(text.get())
            time.sleep(PLAIN_INTERVAL_S)


def _ignore(_: bytes) -> None:
    """Ignore keys: a daemon is only watched."""
